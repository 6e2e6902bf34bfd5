// Marching, evaluating, compositing and differentiating the fast field in one pass over tiles of samples, on all
// threads. Memory is kept from call to call, so that nothing is allocated once sizes have settled.
#pragma once

#include <ATen/core/Tensor.h>

#include <cstdint>
#include <memory>
#include <mutex>
#include <vector>

#include "libeditnerf/kernels/field_tile.h"
#include "libeditnerf/kernels/ray_shading.h"
#include "libeditnerf/kernels/table_scatter.h"

namespace editnerf {

class FusedRays {
 public:
  FusedRays();
  ~FusedRays();

  // Adds the gradients of the loss to the `.grad` of the field's parameters, as backward() would, and those of the
  // states' tables to `states` (made where undefined). One call at a time. The sums do not depend on which thread did
  // what, only on the number of threads.
  RayLossSums AddGradients(const FieldKernel& field, const BundledRays& rays, const RayLoss& loss, FusedStates* states);

  // Fills the picture; returns the samples whose colour was evaluated. Several threads may call it at once.
  int64_t Show(const FieldKernel& field, const BundledRays& rays, const RayPicture& picture);

 private:
  struct Worker;
  struct Part;
  class Lease;

  void TrainPart(const FieldKernel& field, const BundledRays& rays, const RayLoss& loss, Part& part);
  void GoBack(const FieldKernel& field, Worker& worker, Part& part);
  void AddToStates(const FieldKernel& field, const BundledRays& rays, FusedStates* states) const;

  std::mutex mutex_;  // of idle_
  std::vector<std::unique_ptr<Worker>> idle_;
  std::vector<std::unique_ptr<Part>> parts_;
  std::vector<float> to_states_;  // of every ray: key points, local frames, code, appearance
};

// Density of the points x [S, 3], scene units, in the states `state` [S] (int64): [S]. Without gradients.
at::Tensor FusedDensity(const FieldKernel& field, const at::Tensor& x, const at::Tensor& state);

}  // namespace editnerf
