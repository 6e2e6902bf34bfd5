#include "libeditnerf/benchmarks/stability_measure.h"

#include <ATen/ATen.h>
#include <hwy/targets.h>

#include <algorithm>
#include <limits>

namespace editnerf {
namespace {

constexpr double kInfinity = std::numeric_limits<double>::infinity();

// Differences relative to `scale`, and infinity where one of the two is not finite and they do not agree.
double LargestRatio(const at::Tensor& found, const at::Tensor& expected, const at::Tensor& scale) {
  if (found.numel() == 0) return 0;
  const at::Tensor agree = found.eq(expected).logical_or(found.isnan().logical_and(expected.isnan()));
  const at::Tensor comparable = found.isfinite().logical_and(expected.isfinite());
  const at::Tensor ratio = at::where(comparable, (found - expected).abs() / scale, at::full_like(found, kInfinity));
  return at::where(agree, at::zeros_like(found), ratio).max().item<double>();
}

at::Tensor InDouble(const at::Tensor& tensor) { return tensor.detach().to(at::kDouble); }

// Restores the choice of instruction sets however the body ends.
struct AllInstructionSetsAgain {
  AllInstructionSetsAgain() = default;
  AllInstructionSetsAgain(const AllInstructionSetsAgain&) = delete;
  AllInstructionSetsAgain& operator=(const AllInstructionSetsAgain&) = delete;
  ~AllInstructionSetsAgain() {
    hwy::SetSupportedTargetsForTest(0);
    hwy::GetChosenTarget().Update(hwy::SupportedTargets());
  }
};

}  // namespace

bool StabilityRow::Passes() const {
  const auto within = [](const ErrorAndBound& one) { return one.error <= one.bound; };
  return finite && within(value) && (!gradient || within(*gradient));
}

const std::vector<Precision>& Precisions() {
  static const std::vector<Precision> all = {
      {"float64", at::kDouble, std::numeric_limits<double>::epsilon() / 2},
      {"float32", at::kFloat, std::numeric_limits<float>::epsilon() / 2},
  };
  return all;
}

const Precision& SinglePrecision() { return Precisions().back(); }

double LargestRelativeError(const at::Tensor& found, const at::Tensor& expected, double floor) {
  const at::Tensor reference = InDouble(expected);
  return LargestRatio(InDouble(found), reference, reference.abs().clamp_min(floor));
}

double LargestErrorOfRows(const at::Tensor& found, const at::Tensor& expected, double floor) {
  if (found.numel() == 0) return 0;
  const at::Tensor reference = InDouble(expected);
  const at::Tensor scale = reference.abs().nan_to_num(0, 0, 0).amax(-1, true).clamp_min(floor);
  return LargestRatio(InDouble(found), reference, scale.expand_as(reference));
}

bool AllFinite(const std::vector<at::Tensor>& tensors) {
  return std::all_of(tensors.begin(), tensors.end(),
                     [](const at::Tensor& tensor) { return tensor.isfinite().all().item<bool>(); });
}

void ForEachInstructionSet(const std::function<void(const std::string& name)>& body) {
  const AllInstructionSetsAgain afterwards;
  for (const int64_t target : hwy::SupportedAndGeneratedTargets()) {
    hwy::SetSupportedTargetsForTest(target);
    hwy::GetChosenTarget().Update(hwy::SupportedTargets());
    body(hwy::TargetName(target));
  }
}

void FillTile(const at::Tensor& values, TileMemory* tile) {
  const at::Tensor rows = values.to(at::kFloat).contiguous();
  for (int64_t r = 0; r < rows.size(0); ++r) {
    std::fill_n(tile->Row(r), kTileStride, std::numeric_limits<float>::quiet_NaN());
    std::copy_n(rows.data_ptr<float>() + r * rows.size(1), rows.size(1), tile->Row(r));
  }
}

at::Tensor ReadTile(const TileMemory& tile, int64_t rows, int64_t count) {
  at::Tensor values = at::empty({rows, count}, at::kFloat);
  for (int64_t r = 0; r < rows; ++r) std::copy_n(tile.Row(r), count, values.data_ptr<float>() + r * count);
  return values;
}

}  // namespace editnerf
