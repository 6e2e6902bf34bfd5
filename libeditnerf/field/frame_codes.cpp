#include "libeditnerf/field/frame_codes.h"

#include "libeditnerf/base/error.h"
#include "libeditnerf/base/shape.h"

namespace editnerf {

FrameCodesImpl::FrameCodesImpl(int64_t num_frames, int64_t dim, double init) {
  if (num_frames < 1 || dim < 1) {
    Throw<ConfigError>("frame codes: expected at least one frame and one dimension, found {} and {}", num_frames, dim);
  }
  table = register_parameter("table", torch::rand({num_frames, dim}) * init);
}

torch::Tensor FrameCodesImpl::forward(const torch::Tensor& time) {
  CheckShape(time, {kAny}, "time");
  return table.index_select(0, time);
}

}  // namespace editnerf
