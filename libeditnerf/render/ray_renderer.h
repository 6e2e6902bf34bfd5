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
#include "libeditnerf/render/fused_marching.h"
#include "libeditnerf/render/occupancy_grid.h"
#include "libeditnerf/render/ray_batch.h"
#include "libeditnerf/render/ray_marcher.h"

namespace editnerf {

class RayRenderer : public torch::nn::Module {
 public:
  // near and far in scene units. `box` is what marching looks at: nothing outside it is seen (BoxAroundRays of all
  // training cameras is a safe choice). `local_box` adds a second grid over the part's own coordinates, for fields
  // without warp and with one key point: a sample is then evaluated only where both grids are occupied. The
  // hierarchical sampler builds no grid. Throws ConfigError for an unknown sampler or near >= far.
  RayRenderer(const RenderConfig& config, double near, double far, const Box& box,
              const std::optional<Box>& local_box = std::nullopt);

  // Marching without gradients takes the fused kernels where the field offers itself (RadianceField::Fused).
  RayResult Render(RadianceField& field, const RayBatch& rays, const FrameStates& states, const RayOptions& options);

  // Whether Render takes them without gradients.
  bool Fuses(const RadianceField& field, const RayBatch& rays, const FrameStates& states) const;

  // The objective of rays to be trained on, in one fused pass, with its gradients: those of the field's parameters are
  // added to their `.grad`, as backward() does, those of the states returned. Nothing at all, and no result, where
  // marching or field is not of that kind: Render's outputs are then differentiable.
  std::optional<RayGradients> AddGradients(RadianceField& field, const RayBatch& rays, const FrameStates& states,
                                           const RayOptions& options, const RayObjective& objective);

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
  Marching MarchingFor(const RayBatch& rays, const RayOptions& options) const;
  PackedSamples March(RadianceField& field, const RayBatch& rays, const FrameStates& states,
                      const Marching& marching) const;
  torch::Tensor LocalDensityAt(RadianceField& field, const torch::Tensor& x_local, const torch::Tensor& state,
                               const FrameStates& states) const;

  RenderConfig config_;
  double near_, far_;
  std::shared_ptr<OccupancyGrid> grid_, local_grid_;
  std::unique_ptr<FusedMarching> fused_ = std::make_unique<FusedMarching>();
};

}  // namespace editnerf
