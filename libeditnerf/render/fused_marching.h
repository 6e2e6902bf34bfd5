// Marching with the fused kernels, for fields that offer themselves to them (RadianceField::Fused): what RayRenderer
// does in LibTorch's operations, in one pass.
#pragma once

#include <torch/types.h>

#include <optional>

#include "libeditnerf/field/radiance_field.h"
#include "libeditnerf/kernels/fused_rays.h"
#include "libeditnerf/kernels/ray_march.h"
#include "libeditnerf/render/ray_batch.h"

namespace editnerf {

// Where rays are sampled and where they end.
struct Marching {
  double near = 0, far = 0;
  int64_t steps = 0;
  double early_stop = 0;
  OccupancyBits grid;
  std::optional<OccupancyBits> local_grid;
  torch::Tensor jitter;  // [R]
};

class FusedMarching {
 public:
  // Whether these go through the kernels: a field that offers itself, and float32 on the CPU.
  static bool Takes(const std::optional<FusedField>& field, const RayBatch& rays, const FrameStates& states);

  // RayRenderer::Render without gradients.
  RayResult Render(const FusedField& field, const RayBatch& rays, const FusedStates& states, const RayOptions& options,
                   const Marching& marching);

  // RayRenderer::AddGradients, but for what follows from local frames: their own gradient is left in `local_frames`.
  RayGradients AddGradients(const FusedField& field, const RayBatch& rays, const FusedStates& states,
                            const RayOptions& options, const RayObjective& objective, const Marching& marching,
                            torch::Tensor* local_frames);

 private:
  FusedRays kernel_;
};

}  // namespace editnerf
