// The held-out measurement: PSNR over one fixed set of random rays of the validation frames.
#pragma once

#include <torch/types.h>

#include <cstdint>
#include <optional>

#include "libeditnerf/field/radiance_field.h"
#include "libeditnerf/render/ray_renderer.h"
#include "libeditnerf/scene/scene.h"
#include "libeditnerf/training/training_rays.h"

namespace editnerf {

// The states of validation frames, blended from the training frames' where a frame lies between two (scene/timeline.h).
// `frames` are indices into scene.frames; returns one row for each.
FrameStates StatesOfFrames(RadianceField& field, const Scene& scene, const std::vector<int64_t>& frames,
                           torch::Device device);

class HeldOut {
 public:
  HeldOut(const Scene& scene, int64_t num_rays, torch::Device device);

  // Only rays through these pixels [P] int64, counted through the validation frames; as many as there are, if fewer.
  HeldOut(const Scene& scene, const torch::Tensor& pixels, int64_t num_rays, torch::Device device);

  // Decibels; empty for a scene without validation frames, or without pixels. Leaves the random generators alone.
  std::optional<double> Psnr(RadianceField& field, RayRenderer& renderer) const;

 private:
  const Scene& scene_;
  torch::Device device_;
  std::optional<RayTargets> rays_;
};

}  // namespace editnerf
