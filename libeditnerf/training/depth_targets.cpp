#include "libeditnerf/training/depth_targets.h"

#include "libeditnerf/base/error.h"
#include "libeditnerf/base/safetensors.h"

namespace editnerf {
namespace {

bool Within(const torch::Tensor& values, int64_t begin, int64_t end) {
  return values.numel() == 0 || (values.min().item<int64_t>() >= begin && values.max().item<int64_t>() < end);
}

bool FiniteAndPositive(const torch::Tensor& values) {
  return (torch::isfinite(values) & (values > 0)).all().item<bool>();
}

}  // namespace

DepthTargets Joined(const DepthTargets& a, const DepthTargets& b) {
  if (b.size() == 0) return a;
  if (a.size() == 0) return b;
  return {torch::cat({a.frame, b.frame}), torch::cat({a.pixel, b.pixel}), torch::cat({a.distance, b.distance}),
          torch::cat({a.tolerance, b.tolerance}), torch::cat({a.key_point, b.key_point})};
}

void WriteDepthTargets(const std::filesystem::path& path, const DepthTargets& targets) {
  WriteSafetensors(path, {{"frame", targets.frame},
                          {"pixel", targets.pixel},
                          {"distance", targets.distance},
                          {"tolerance", targets.tolerance},
                          {"key_point", targets.key_point}});
}

DepthTargets ReadDepthTargets(const std::filesystem::path& path, int64_t frames, int64_t height, int64_t width,
                              int64_t key_points) {
  SafetensorsFile file = ReadSafetensors(path);
  for (const char* name : {"frame", "pixel", "distance", "tolerance", "key_point"})
    if (file.tensors.count(name) == 0)
      Throw<DataError>("{}: found no tensor \"{}\"; detect again", path.string(), name);
  DepthTargets targets = {file.tensors["frame"], file.tensors["pixel"], file.tensors["distance"],
                          file.tensors["tolerance"], file.tensors["key_point"]};
  const int64_t count = targets.distance.numel();
  const bool fits =
      targets.frame.scalar_type() == torch::kInt64 && targets.key_point.scalar_type() == torch::kInt64 &&
      targets.pixel.scalar_type() == torch::kInt64 && targets.distance.scalar_type() == torch::kFloat32 &&
      targets.tolerance.scalar_type() == torch::kFloat32 && targets.frame.sizes() == torch::IntArrayRef{count} &&
      targets.pixel.sizes() == torch::IntArrayRef({count, 2}) && targets.distance.dim() == 1 &&
      targets.tolerance.sizes() == torch::IntArrayRef{count} && targets.key_point.sizes() == torch::IntArrayRef{count};
  if (!fits) {
    Throw<DataError>("{}: expected frame [M], key_point [M] and pixel [M, 2] int64, distance and tolerance [M] float32",
                     path.string());
  }
  if (!Within(targets.frame, 0, frames) || !Within(targets.pixel.select(1, 0), 0, width) ||
      !Within(targets.pixel.select(1, 1), 0, height)) {
    Throw<DataError>("{}: holds places outside {} frames of {} x {} pixels; detect again on this scene", path.string(),
                     frames, width, height);
  }
  if (!Within(targets.key_point, kOtherLight, key_points)) {
    Throw<DataError>("{}: names a key point that is none of the {} in data/k_points_auto.txt; detect again",
                     path.string(), key_points);
  }
  if (!FiniteAndPositive(targets.distance) || !FiniteAndPositive(targets.tolerance)) {
    Throw<DataError>("{}: a distance or tolerance is not finite and positive", path.string());
  }
  return targets;
}

}  // namespace editnerf
