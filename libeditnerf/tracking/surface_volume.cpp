#include "libeditnerf/tracking/surface_volume.h"

#include <algorithm>
#include <cmath>
#include <numeric>

#include "libeditnerf/base/error.h"
#include "libeditnerf/base/shape.h"

namespace editnerf {
namespace {

constexpr double kLowPercentile = 0.01, kHighPercentile = 0.99;
constexpr int64_t kMarginVoxels = 3;
constexpr size_t kPercentileSamples = 1 << 20;

struct Grid {
  Vec3 origin;
  double voxel_size;
  std::array<int64_t, 3> size;

  // Flat index of the voxel that holds a point, or -1.
  int64_t Index(const float* p) const {
    const double o[3] = {origin.x, origin.y, origin.z};
    int64_t index = 0;
    for (int axis = 0; axis < 3; ++axis) {
      const double cell = std::floor((p[axis] - o[axis]) / voxel_size);
      if (!(cell >= 0 && cell < static_cast<double>(size[axis]))) return -1;
      index = index * size[axis] + static_cast<int64_t>(cell);
    }
    return index;
  }
};

bool Finite(const float* p) { return std::isfinite(p[0]) && std::isfinite(p[1]) && std::isfinite(p[2]); }

Grid FitGrid(const torch::Tensor& points, int64_t resolution) {
  const int64_t count = points.numel() / 3;
  const float* p = points.data_ptr<float>();
  const int64_t step = std::max<int64_t>(1, count / static_cast<int64_t>(kPercentileSamples));
  double low[3], high[3];
  for (int axis = 0; axis < 3; ++axis) {
    std::vector<float> values;
    for (int64_t i = 0; i < count; i += step)
      if (Finite(p + 3 * i)) values.push_back(p[3 * i + axis]);
    if (values.empty())
      Throw<DataError>(
          "surface volume: no pixel of any frame has a surface; the pretrained depth is empty: pretrain for longer, or "
          "look whether the camera poses are right");
    const auto at = [&values](double share) {
      const auto k = static_cast<int64_t>(share * static_cast<double>(values.size() - 1));
      std::nth_element(values.begin(), values.begin() + k, values.end());
      return static_cast<double>(values[static_cast<size_t>(k)]);
    };
    low[axis] = at(kLowPercentile);
    high[axis] = at(kHighPercentile);
  }
  const double longest = std::max({high[0] - low[0], high[1] - low[1], high[2] - low[2], 1e-6});
  Grid grid;
  grid.voxel_size = longest / static_cast<double>(std::max<int64_t>(resolution - 2 * kMarginVoxels, 1));
  const double margin = static_cast<double>(kMarginVoxels) * grid.voxel_size;
  grid.origin = {low[0] - margin, low[1] - margin, low[2] - margin};
  for (int axis = 0; axis < 3; ++axis) {
    const auto cells = static_cast<int64_t>(std::ceil((high[axis] - low[axis]) / grid.voxel_size - 1e-6));
    grid.size[static_cast<size_t>(axis)] = std::max<int64_t>(cells, 1) + 2 * kMarginVoxels;
  }
  return grid;
}

// One separable pass along `axis`; values outside count as zero, as they do for the mask.
torch::Tensor GaussianPass(const torch::Tensor& volume, const std::vector<float>& kernel, int64_t axis) {
  const auto radius = static_cast<int64_t>(kernel.size() / 2);
  torch::Tensor result = torch::zeros_like(volume);
  const int64_t size = volume.size(axis);
  for (int64_t offset = -radius; offset <= radius; ++offset) {
    const int64_t overlap = size - std::abs(offset);
    if (overlap <= 0) continue;
    result.narrow(axis, std::max<int64_t>(-offset, 0), overlap)
        .add_(volume.narrow(axis, std::max<int64_t>(offset, 0), overlap), kernel[static_cast<size_t>(offset + radius)]);
  }
  return result;
}

}  // namespace

double SurfaceVolume::LongestSide() const {
  return voxel_size * static_cast<double>(std::max({smoothed.size(0), smoothed.size(1), smoothed.size(2)}));
}

torch::Tensor MaskedGaussian(const torch::Tensor& values, const torch::Tensor& mask, double sigma) {
  CheckShape(values, {kAny, kAny, kAny}, "volume");
  CheckShape(mask, {values.size(0), values.size(1), values.size(2)}, "volume mask");
  if (sigma < 1e-3) return values * mask;
  const auto radius = static_cast<int64_t>(std::ceil(3 * sigma));
  std::vector<float> kernel;
  for (int64_t i = -radius; i <= radius; ++i)
    kernel.push_back(static_cast<float>(std::exp(-0.5 * static_cast<double>(i * i) / (sigma * sigma))));
  const float sum = std::accumulate(kernel.begin(), kernel.end(), 0.0f);
  for (float& k : kernel) k /= sum;
  torch::Tensor weighted = values * mask, support = mask;
  for (int64_t axis = 0; axis < 3; ++axis) {
    weighted = GaussianPass(weighted, kernel, axis);
    support = GaussianPass(support, kernel, axis);
  }
  const double plane = kernel[static_cast<size_t>(radius)];  // what a plane of voxels gives at its own voxels
  return weighted / support.clamp_min(plane / 3) * mask;
}

SurfaceVolume BuildSurfaceVolume(const torch::Tensor& points, const torch::Tensor& ambient,
                                 const SurfaceVolumeOptions& options, const torch::Tensor& moving) {
  CheckShape(points, {kAny, kAny, kAny, 3}, "surface points");
  CheckShape(ambient, {points.size(0), points.size(1), points.size(2), kAny}, "ambient coordinates");
  const torch::Tensor all_points = points.to(torch::kFloat32).contiguous();
  const torch::Tensor all_ambient = ambient.to(torch::kFloat32).contiguous();
  torch::Tensor all_moving;
  if (moving.defined()) {
    CheckShape(moving, {points.size(0), points.size(1), points.size(2)}, "moving pixels");
    all_moving = moving.to(torch::kBool).contiguous();
  }
  const int64_t frames = points.size(0), height = points.size(1), width = points.size(2), dims = ambient.size(3);
  const Grid grid = FitGrid(all_points, options.resolution);
  const auto voxels = static_cast<size_t>(grid.size[0] * grid.size[1] * grid.size[2]);
  const auto width_a = static_cast<size_t>(dims);

  // Welford's update over frames: stable in float32 where a sum of squares is not.
  std::vector<float> mean(voxels * width_a, 0.0f), squares(voxels * width_a, 0.0f), frame_sum(voxels * width_a, 0.0f);
  std::vector<int32_t> observed(voxels, 0), frame_count(voxels, 0), frame_moving(voxels, 0), moved(voxels, 0);
  std::vector<size_t> touched;
  for (int64_t t = 0; t < frames; ++t) {
    touched.clear();
    for (int64_t row = 0; row < height; row += options.stride) {
      for (int64_t column = 0; column < width; column += options.stride) {
        const int64_t pixel = (t * height + row) * width + column;
        const float* p = all_points.data_ptr<float>() + 3 * pixel;
        const float* a = all_ambient.data_ptr<float>() + dims * pixel;
        if (!Finite(p) || !std::all_of(a, a + dims, [](float value) { return std::isfinite(value); })) continue;
        const int64_t index = grid.Index(p);
        if (index < 0) continue;
        const auto voxel = static_cast<size_t>(index);
        if (frame_count[voxel]++ == 0) touched.push_back(voxel);
        for (size_t d = 0; d < width_a; ++d) frame_sum[voxel * width_a + d] += a[d];
        if (all_moving.defined() && all_moving.data_ptr<bool>()[pixel]) ++frame_moving[voxel];
      }
    }
    for (const size_t voxel : touched) {
      const auto n = static_cast<float>(++observed[voxel]);
      for (size_t d = voxel * width_a; d < (voxel + 1) * width_a; ++d) {
        const float value = frame_sum[d] / static_cast<float>(frame_count[voxel]);
        const float delta = value - mean[d];
        mean[d] += delta / n;
        squares[d] += delta * (value - mean[d]);
        frame_sum[d] = 0;
      }
      if (2 * frame_moving[voxel] > frame_count[voxel]) ++moved[voxel];
      frame_count[voxel] = frame_moving[voxel] = 0;
    }
  }

  SurfaceVolume volume;
  volume.origin = grid.origin;
  volume.voxel_size = grid.voxel_size;
  const auto shape = {grid.size[0], grid.size[1], grid.size[2]};
  volume.observations = torch::from_blob(observed.data(), shape, torch::kInt32).clone();
  volume.variance = torch::zeros(shape, torch::kFloat32);
  float* variance = volume.variance.data_ptr<float>();
  for (size_t voxel = 0; voxel < voxels; ++voxel) {
    if (observed[voxel] < std::max<int64_t>(options.min_observations, 2)) continue;
    float sum = 0;
    for (size_t d = 0; d < width_a; ++d) sum += squares[voxel * width_a + d];
    variance[voxel] = sum / (static_cast<float>(observed[voxel]) * static_cast<float>(dims));
  }
  const torch::Tensor mask = volume.observations.ge(std::max<int64_t>(options.min_observations, 2)).to(torch::kFloat32);
  torch::Tensor evidence = volume.variance;
  if (all_moving.defined()) {
    volume.moving = torch::from_blob(moved.data(), shape, torch::kInt32).clone();
    evidence = volume.variance.sqrt() * volume.moving;
  }
  volume.smoothed = MaskedGaussian(evidence, mask, options.smoothing);
  return volume;
}

std::vector<VolumeMaximum> LocalMaxima(const SurfaceVolume& volume, double min_distance, double relative_threshold) {
  CheckShape(volume.smoothed, {kAny, kAny, kAny}, "smoothed variance");
  const torch::Tensor smoothed = volume.smoothed.contiguous();
  const int64_t sx = smoothed.size(0), sy = smoothed.size(1), sz = smoothed.size(2);
  const float* v = smoothed.data_ptr<float>();
  const double strongest = smoothed.max().item<double>();
  std::vector<VolumeMaximum> found;
  if (!(strongest > 0)) return found;
  const auto at = [&](int64_t x, int64_t y, int64_t z) { return v[(x * sy + y) * sz + z]; };
  for (int64_t x = 0; x < sx; ++x) {
    for (int64_t y = 0; y < sy; ++y) {
      for (int64_t z = 0; z < sz; ++z) {
        const float value = at(x, y, z);
        if (!(value > 0) || value < relative_threshold * strongest) continue;
        bool highest = true;
        for (int64_t n = 0; n < 27 && highest; ++n) {
          const int64_t i = x + n / 9 - 1, j = y + n / 3 % 3 - 1, k = z + n % 3 - 1;
          if (i < 0 || j < 0 || k < 0 || i >= sx || j >= sy || k >= sz) continue;
          highest = at(i, j, k) <= value;
        }
        if (highest) found.push_back({volume.Center(x, y, z), value, {x, y, z}});
      }
    }
  }
  std::stable_sort(found.begin(), found.end(), [](const auto& a, const auto& b) { return a.value > b.value; });
  const double radius = min_distance * volume.LongestSide();
  std::vector<VolumeMaximum> kept;
  for (const VolumeMaximum& maximum : found) {
    const bool near = std::any_of(kept.begin(), kept.end(),
                                  [&](const auto& other) { return Norm(other.point - maximum.point) < radius; });
    if (!near) kept.push_back(maximum);
  }
  return kept;
}

}  // namespace editnerf
