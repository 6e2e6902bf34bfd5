// The fast field and rays through it, as FieldKernelCases and FieldPartCases measure them: the same calls in one fused
// pass and, while a PlainOperations lives, in plain LibTorch operations.
#pragma once

#include <torch/types.h>

#include <memory>
#include <string>
#include <vector>

#include "libeditnerf/field/hyperspace_field.h"
#include "libeditnerf/render/ray_renderer.h"

namespace editnerf {

// What a scene needs of the field. No warp, which no kernel fuses.
struct FieldParts {
  std::string name;
  FieldStage stage = FieldStage::kTrain;
  int64_t key_points = 0;  // of training
  bool view_direction = true, appearance = false, local_frames = false;
};

FieldParts OneKeyPoint();
// From what every scene needs to more; OneKeyPoint() is among them.
std::vector<FieldParts> AllFieldParts();

struct FieldSetting {
  std::shared_ptr<HyperspaceField> field;
  std::shared_ptr<RayRenderer> renderer;
  RayBatch rays;  // all of their samples lie in a grid that is occupied everywhere
  RayOptions options;
  RayObjective objective;
  torch::Tensor x, state;  // [S, 3], scene units, and [S]: points in the field
};

// With as many samples along all rays, and points, as fill whole rays. kernel: as field.fast.kernel. The rays and
// points of one size are always the same, and so are the weights of the same parts.
FieldSetting MakeFieldSetting(const Config& config, const FieldParts& parts, const std::string& kernel,
                              int64_t samples);

torch::Tensor DensityOfPoints(const FieldSetting& setting);  // [S], without gradients
torch::Tensor ColorOfRays(const FieldSetting& setting);      // [R, 3], without gradients
// Reconstruction and distortion; adds its gradients to the `.grad` of all parameters, those of the frames' states
// included.
double AddLossGradients(const FieldSetting& setting);

}  // namespace editnerf
