// From rays to colours, depth and surface points, with either sampler of RenderConfig:
//   hierarchical: stratified samples, then more from the coarse weights; the fine level sees all of them (NeRF). Where
//                 the field has no coarse level of its own, its density alone, without gradients, places the samples.
//   occupancy:    equal steps where the occupancy grids allow, a density-only pass that drops what lies behind
//                 early_stop, then the field on the rest.
// Without a background the hierarchical sampler ends every ray at an opaque last sample, as the paper does, and
// marching shows black behind the last one; with a background both show it through what is transparent.
#pragma once

#include <torch/nn/module.h>
#include <torch/types.h>

#include <memory>
#include <optional>

#include "libeditnerf/config/config.h"
#include "libeditnerf/field/radiance_field.h"
#include "libeditnerf/render/compositing.h"
#include "libeditnerf/render/occupancy_grid.h"
#include "libeditnerf/render/ray_marcher.h"

namespace editnerf {

struct RayBatch {
  torch::Tensor origin;     // [R, 3], scene units
  torch::Tensor direction;  // [R, 3], unit length
  torch::Tensor state;      // [R] int64, row of FrameStates
};

struct RayOptions {
  bool training = false;     // random sample positions, and the coarse level's colours
  torch::Tensor background;  // [3] or [R, 3]; undefined: see above
  bool surface = true;       // fill RayResult's surface outputs
  bool distortion = false;   // fill RayResult's distortion
  torch::Tensor distance;    // [R], known distance to the surface, NaN where unknown; undefined: nothing is known
  torch::Tensor tolerance;   // [R], share of the distance within which any is as good; given with it
  // Marching alone:
  torch::Tensor jitter;     // [R] in [0, 1], where in their intervals samples lie; undefined: random where training,
                            // otherwise the middle
  int64_t march_steps = 0;  // 0: as configured
  bool depth_only = false;  // no colours, and nothing behind the surface (median depth) is evaluated
};

struct RayResult {
  torch::Tensor rgb;          // [R, 3]
  torch::Tensor rgb_coarse;   // [R, 3]; undefined unless training a field that has a coarse level
  torch::Tensor opacity;      // [R]; an opaque end does not count
  torch::Tensor depth;        // [R], distance to the surface (median); NaN where there is none
  torch::Tensor depth_valid;  // [R] bool

  // At the surface sample; without meaning where depth_valid is false. Undefined where the field has no such output.
  torch::Tensor x_observed;   // [R, 3]
  torch::Tensor x_canonical;  // [R, 3]
  torch::Tensor ambient;      // [R, A]
  torch::Tensor weights;      // [R, N], of the key points

  torch::Tensor distortion;  // [R], DistortionLoss with 0 at near and 1 at far; undefined unless asked for
  torch::Tensor depth_miss;  // [], the mean of DepthMiss over the rays; undefined without RayOptions::distance
  int64_t samples = 0;       // field evaluations with colour
};

class RayRenderer : public torch::nn::Module {
 public:
  // near and far in scene units. `box` is what marching looks at: nothing outside it is seen (BoxAroundRays of all
  // training cameras is a safe choice). `local_box` adds a second grid over x - p, for fields without warp and with one
  // key point: a sample is then evaluated only where both grids are occupied. The hierarchical sampler builds no grid.
  // Throws ConfigError for an unknown sampler or near >= far.
  RayRenderer(const RenderConfig& config, double near, double far, const Box& box,
              const std::optional<Box>& local_box = std::nullopt);

  RayResult Render(RadianceField& field, const RayBatch& rays, const FrameStates& states, const RayOptions& options);

  // One update of the grids, each cell with a random row of `states` (usually all training states). Does nothing for
  // the hierarchical sampler.
  void UpdateOccupancy(RadianceField& field, const FrameStates& states);

  // Marks what any row of `states` occupies and forgets nothing. To be called before rendering states that training
  // never showed: a part moved to a new place is otherwise missing there.
  void CoverStates(RadianceField& field, const FrameStates& states);

  double near() const { return near_; }
  double far() const { return far_; }
  const OccupancyGrid* occupancy() const { return grid_.get(); }  // nullptr for the hierarchical sampler

 private:
  RayResult RenderHierarchical(RadianceField& field, const RayBatch& rays, const FrameStates& states,
                               const RayOptions& options);
  RayResult RenderMarching(RadianceField& field, const RayBatch& rays, const FrameStates& states,
                           const RayOptions& options);
  PackedSamples March(const RayBatch& rays, const FrameStates& states, int64_t steps,
                      const torch::Tensor& jitter) const;
  torch::Tensor LocalDensityAt(RadianceField& field, const torch::Tensor& x_local, const torch::Tensor& state,
                               const FrameStates& states) const;

  RenderConfig config_;
  double near_, far_;
  std::shared_ptr<OccupancyGrid> grid_, local_grid_;
};

}  // namespace editnerf
