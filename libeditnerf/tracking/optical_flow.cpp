#include "libeditnerf/tracking/optical_flow.h"

#include <algorithm>

#include "libeditnerf/base/error.h"
#include "libeditnerf/base/shape.h"

namespace editnerf {

std::shared_ptr<const OpticalFlow::Prepared> OpticalFlow::Prepare(const torch::Tensor& image) const {
  auto prepared = std::make_shared<Prepared>();
  prepared->image = image;
  return prepared;
}

torch::Tensor OpticalFlow::FlowBetween(const Prepared& from, const Prepared& to, const torch::Tensor& guess) const {
  return guess.defined() ? FlowFrom(from.image, to.image, guess) : Flow(from.image, to.image);
}

void OpticalFlow::CheckImages(const torch::Tensor& from, const torch::Tensor& to) {
  constexpr int64_t kSmallestSide = 16;
  CheckShape(from, {kAny, kAny, 3}, "first image");
  CheckShape(to, {from.size(0), from.size(1), 3}, "second image");
  if (from.scalar_type() != torch::kUInt8 || to.scalar_type() != torch::kUInt8) {
    Throw<ShapeError>("optical flow: expected uint8 images, found {} and {}", c10::toString(from.scalar_type()),
                      c10::toString(to.scalar_type()));
  }
  if (std::min(from.size(0), from.size(1)) < kSmallestSide) {
    Throw<DataError>("optical flow: found images of {} x {} pixels, expected at least {} a side", from.size(1),
                     from.size(0), kSmallestSide);
  }
}

void OpticalFlow::CheckGuess(const torch::Tensor& from, const torch::Tensor& guess) {
  CheckShape(guess, {from.size(0), from.size(1), 2}, "guessed flow");
}

}  // namespace editnerf
