// A made video: a textured disc that moves to the right and down over a textured ground that stands still.
#pragma once

#include <torch/types.h>

#include <cstdint>
#include <filesystem>

#include "libeditnerf/imaging/video_file.h"
#include "libeditnerf/tracking/map_lookup.h"

namespace editnerf {

inline Pixel MovingPatchCenter(int64_t frame) {
  const auto t = static_cast<double>(frame);
  return {40 + 3 * t, 40 + 1.5 * t};
}

// uint8 [96, 128, 3]
inline torch::Tensor MovingPatch(int64_t frame) {
  const Pixel center = MovingPatchCenter(frame);
  const auto v = torch::arange(96, torch::kFloat64).view({-1, 1}) + 0.5;
  const auto u = torch::arange(128, torch::kFloat64).view({1, -1}) + 0.5;
  const auto texture = [](const torch::Tensor& x, const torch::Tensor& y) {
    return torch::sin(0.35 * x + 0.1 * y) + torch::sin(0.3 * y - 0.13 * x) + torch::sin(0.11 * x + 0.17 * y);
  };
  const auto x = u - center.u, y = v - center.v;
  const auto disc = x.square() + y.square() < 22 * 22;
  const auto value = torch::where(disc, 130 + 38 * texture(1.7 * x, 1.7 * y), 110 + 25 * texture(u + 0 * v, v + 0 * u));
  return value.clamp(0, 255).to(torch::kUInt8).unsqueeze(2).expand({-1, -1, 3}).contiguous();
}

inline void WriteMovingPatch(const std::filesystem::path& path, int64_t frames) {
  VideoWriter video(path, 128, 96, 12);
  for (int64_t t = 0; t < frames; ++t) video.Write(MovingPatch(t));
  video.Finish();
}

}  // namespace editnerf
