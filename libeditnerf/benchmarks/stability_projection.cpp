// Projection of points at, behind and beside cameras from 1e-3 to 1e6 pixels of focal length, also badly distorted.
#include <torch/autograd.h>
#include <torch/types.h>
#include <torch/utils.h>

#include <algorithm>
#include <cmath>
#include <complex>
#include <limits>

#include "libeditnerf/benchmarks/stability_measure.h"
#include "libeditnerf/geometry/camera_tensors.h"
#include "libeditnerf/geometry/projection.h"

namespace editnerf {
namespace {

constexpr int64_t kPoints = 100;
using Complex = std::complex<Real>;

struct Scene {
  std::string name;
  torch::Tensor point;  // [P, 3] float64, in the axes of the camera
  bool visible = true;  // whether all of them or none are to be valid
};

struct Pixels {
  torch::Tensor pixel, gradient;  // [P, 2] and [P, 3], with respect to the point
};

Camera CameraOf(double focal_length, bool distorted) {
  Camera camera;
  camera.focal_length = focal_length;
  camera.principal_point = {320.5, 239.5};
  camera.skew = 0.25;
  camera.pixel_aspect_ratio = 1.125;
  camera.width = 640, camera.height = 480;
  if (distorted) camera.radial_distortion = {-0.5, 0.25, 0.125}, camera.tangential_distortion = {0.0625, -0.03125};
  return camera;
}

// Powers of the radius and products written out, of complex numbers.
void ProjectComplex(const Camera& c, const Complex p[3], Complex pixel[2]) {
  const Complex x = p[0] / p[2], y = p[1] / p[2], r = x * x + y * y;
  const auto real = [](double value) { return static_cast<Real>(value); };
  Complex radial = 1, power = 1;
  for (const double k : c.radial_distortion) radial += real(k) * (power *= r);
  const Real p1 = real(c.tangential_distortion[0]), p2 = real(c.tangential_distortion[1]);
  const Complex xd = x * radial + 2 * p1 * x * y + p2 * (r + Complex(2) * x * x);
  const Complex yd = y * radial + 2 * p2 * x * y + p1 * (r + Complex(2) * y * y);
  pixel[0] = real(c.focal_length) * xd + real(c.skew) * yd + real(c.principal_point[0]);
  pixel[1] = real(c.focal_length) * real(c.pixel_aspect_ratio) * yd + real(c.principal_point[1]);
}

// Slopes by a step of 1e-40 along the imaginary axis: exact to rounding, as nothing is subtracted.
Pixels Expected(const Camera& camera, const torch::Tensor& point, const torch::Tensor& upstream) {
  Pixels expected = {torch::empty({point.size(0), 2}, torch::kFloat64), torch::empty_like(point)};
  const Real step = std::pow(static_cast<Real>(10), -40);
  for (int64_t i = 0; i < point.size(0); ++i) {
    for (int axis = 0; axis < 3; ++axis) {
      Complex p[3], pixel[2];
      for (int k = 0; k < 3; ++k) p[k] = {point.data_ptr<double>()[3 * i + k], k == axis ? step : 0};
      ProjectComplex(camera, p, pixel);
      Real slope = 0;
      for (int k = 0; k < 2; ++k) {
        expected.pixel[i][k] = static_cast<double>(pixel[k].real());
        slope += static_cast<Real>(upstream.data_ptr<double>()[2 * i + k]) * (pixel[k].imag() / step);
      }
      expected.gradient[i][axis] = static_cast<double>(slope);
    }
  }
  return expected;
}

torch::Tensor Points(double beside, double depth) {
  auto points = (torch::rand({kPoints, 3}, torch::kFloat64) * 2 - 1) * beside;
  points.select(1, 2).fill_(depth);
  return points;
}

std::vector<Scene> AllScenes() {
  torch::manual_seed(6);
  constexpr double kNan = std::numeric_limits<double>::quiet_NaN(), kInfinity = std::numeric_limits<double>::infinity();
  const auto broken = torch::tensor({kNan, kInfinity, -kInfinity, 1e30}, torch::kFloat64);
  auto beside = Points(1, 1e-5);
  beside.select(1, 0).fill_(1);
  return {{"before the camera", Points(0.5, 2), true},
          {"1e-5 before it", Points(0.5e-5, 1e-5), true},
          {"1e8 before it", Points(0.5e8, 1e8), true},
          {"80 degrees off its axis", Points(4, 0.7), true},
          {"in its plane", Points(1, 0), false},
          {"in its centre", Points(0, 0), false},
          {"behind it", Points(1, -1), false},
          {"beside it, 89.9994 degrees off", beside, false},
          {"NaN, infinite and 1e30", broken.index({torch::randint(4, {kPoints, 3}, torch::kInt64)}), false}};
}

StabilityRow RowOfCamera(const Camera& camera, const Scene& scene, const Precision& precision) {
  const auto given = scene.point.to(precision.type);
  const auto upstream = torch::rand({kPoints, 2}, torch::kFloat64).to(precision.type);
  const auto leaf = given.clone().requires_grad_(true);
  const auto frame = torch::zeros({kPoints}, torch::kInt64);
  const auto projected = ProjectPoints(StackCameras({camera}, precision.type), frame, leaf);
  const auto gradient = torch::autograd::grad({(projected.pixel * upstream).sum()}, {leaf})[0];
  StabilityRow row = {"projection",
                      scene.name + (camera.HasDistortion() ? ", distorted" : ""),
                      "LibTorch " + precision.name,
                      {},
                      ErrorAndBound{},
                      true};
  Pixels expected = {torch::zeros({kPoints, 2}, torch::kFloat64), torch::zeros({kPoints, 3}, torch::kFloat64)};
  if (scene.visible) expected = Expected(camera, given.to(torch::kFloat64), upstream.to(torch::kFloat64));
  const bool as_said = projected.valid.eq(scene.visible).all().item<bool>();
  const double bound = 64 * precision.rounding;  // of a polynomial of degree seven
  // Where distortion folds the picture over, a position is a difference of larger numbers: relative to the largest of
  // the points together.
  const auto error = [](const torch::Tensor& found, const torch::Tensor& wanted) {
    return LargestErrorOfRows(found.detach().reshape({1, -1}), wanted.reshape({1, -1}), 1e-30);
  };
  row.value = {as_said ? error(projected.pixel, expected.pixel) : std::numeric_limits<double>::infinity(), bound};
  row.gradient = {error(gradient, expected.gradient), bound};
  row.finite = AllFinite({projected.pixel, projected.depth_along_axis, projected.distance, gradient});
  return row;
}

// The worst of short, usual and long focal lengths.
StabilityRow RowOf(bool distorted, const Scene& scene, const Precision& precision) {
  StabilityRow worst = RowOfCamera(CameraOf(500, distorted), scene, precision);
  for (const double focal_length : {1e-3, 1e6}) {
    const StabilityRow row = RowOfCamera(CameraOf(focal_length, distorted), scene, precision);
    worst.value.error = std::max(worst.value.error, row.value.error);
    worst.gradient->error = std::max(worst.gradient->error, row.gradient->error);
    worst.finite = worst.finite && row.finite;
  }
  return worst;
}

}  // namespace

StabilityRows ProjectionStability() {
  StabilityRows rows;
  for (const Scene& scene : AllScenes()) {
    for (const bool distorted : {false, true}) {
      for (const Precision& precision : Precisions()) rows.push_back(RowOf(distorted, scene, precision));
    }
  }
  return rows;
}

}  // namespace editnerf
