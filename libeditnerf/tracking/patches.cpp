#include "libeditnerf/tracking/patches.h"

#include <cmath>

namespace editnerf {
namespace {

constexpr double kLeastVariance = 1;  // grey levels squared: below it there is only noise

// Of as many values each; 0 where one of them hardly varies.
double Correlation(const std::vector<double>& a, const std::vector<double>& b) {
  double sum_a = 0, sum_b = 0, sum_aa = 0, sum_bb = 0, sum_ab = 0;
  const auto count = static_cast<double>(a.size());
  for (size_t i = 0; i < a.size(); ++i)
    sum_a += a[i], sum_b += b[i], sum_aa += a[i] * a[i], sum_bb += b[i] * b[i], sum_ab += a[i] * b[i];
  const double variance_a = sum_aa / count - sum_a * sum_a / (count * count);
  const double variance_b = sum_bb / count - sum_b * sum_b / (count * count);
  if (variance_a < kLeastVariance || variance_b < kLeastVariance) return 0;
  return (sum_ab / count - sum_a * sum_b / (count * count)) / std::sqrt(variance_a * variance_b);
}

std::vector<Pixel> Square(const Pixel& center, int64_t radius) {
  std::vector<Pixel> pixels;
  for (int64_t dv = -radius; dv <= radius; ++dv)
    for (int64_t du = -radius; du <= radius; ++du)
      pixels.push_back({center.u + static_cast<double>(du), center.v + static_cast<double>(dv)});
  return pixels;
}

std::vector<double> GreysAt(const torch::Tensor& gray, const std::vector<Pixel>& pixels) {
  const GreyImage image(gray);
  std::vector<double> values;
  values.reserve(pixels.size());
  for (const Pixel& p : pixels) values.push_back(image.At(p));
  return values;
}

}  // namespace

double PatchSimilarity(const torch::Tensor& gray_a, const Pixel& a, const torch::Tensor& gray_b, const Pixel& b,
                       int64_t radius) {
  const auto margin = static_cast<double>(radius) + 0.5;
  const auto fits = [margin](const torch::Tensor& gray, const Pixel& p) {
    return p.u - margin >= 0 && p.v - margin >= 0 && p.u + margin + 1 < static_cast<double>(gray.size(1)) &&
           p.v + margin + 1 < static_cast<double>(gray.size(0));
  };
  if (!fits(gray_a, a) || !fits(gray_b, b)) return 0;
  return Correlation(GreysAt(gray_a, Square(a, radius)), GreysAt(gray_b, Square(b, radius)));
}

CarriedPatch::CarriedPatch(const Clip& clip, int64_t t, const Pixel& center, int64_t radius)
    : clip_(clip), pixels_(Square(center, radius)), before_(GreysAt(clip.gray[static_cast<size_t>(t)], pixels_)) {}

void CarriedPatch::Carry(int64_t t, int64_t step) {
  for (Pixel& p : pixels_) {
    const FlowSample flow = clip_.Step(t, step, p);
    if (flow.valid) p = {p.u + flow.du, p.v + flow.dv};
  }
}

double CarriedPatch::Similarity(int64_t t) const {
  return Correlation(before_, GreysAt(clip_.gray[static_cast<size_t>(t)], pixels_));
}

}  // namespace editnerf
