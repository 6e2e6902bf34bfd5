// Dense optical flow between two images.
//
// A flow map F holds, at the pixel in row r and column c (centre (c + 0.5, r + 0.5)), the displacement in pixels (x, y)
// that brings it to its place in the other image. NaN marks pixels for which an implementation has no answer.
#pragma once

#include <torch/types.h>

#include <cstdint>

namespace editnerf {

class OpticalFlow {
 public:
  virtual ~OpticalFlow() = default;

  // from, to [H, W, 3] uint8 RGB, CPU -> [H, W, 2] float32. May be called from several threads at once.
  // Throws ShapeError unless both images have the same size.
  virtual torch::Tensor Flow(const torch::Tensor& from, const torch::Tensor& to) const = 0;

  // The same with a guess [H, W, 2] float32 to begin from, such as StillFlow (still_flow.h): what is left to be found
  // may then be far smaller than what the camera causes. By default the guess is not looked at.
  virtual torch::Tensor FlowFrom(const torch::Tensor& from, const torch::Tensor& to, const torch::Tensor& guess) const {
    CheckGuess(from, guess);
    return Flow(from, to);
  }

 protected:
  static void CheckGuess(const torch::Tensor& from, const torch::Tensor& guess);  // throws ShapeError
};

// Dense inverse search (Kroeger et al., ECCV 2016) with variational refinement, as OpenCV implements it. Patches are
// matched down to full resolution, because at 320 pixels across every halving costs thin parts. The result does not
// depend on the number of threads. Images under 16 pixels a side throw DataError.
class DisFlow : public OpticalFlow {
 public:
  torch::Tensor Flow(const torch::Tensor& from, const torch::Tensor& to) const override;
  torch::Tensor FlowFrom(const torch::Tensor& from, const torch::Tensor& to, const torch::Tensor& guess) const override;

 private:
  static torch::Tensor Search(const torch::Tensor& from, const torch::Tensor& to, const torch::Tensor& guess);
};

}  // namespace editnerf
