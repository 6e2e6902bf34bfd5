// Dense optical flow between two images.
//
// A flow map F holds, at the pixel in row r and column c (centre (c + 0.5, r + 0.5)), the displacement in pixels (x, y)
// that brings it to its place in the other image. NaN marks pixels for which an implementation has no answer.
#pragma once

#include <torch/types.h>

#include <cstdint>
#include <memory>
#include <string>

namespace editnerf {

class OpticalFlow {
 public:
  // An image and what an implementation computes of it once for all flows from and to it.
  struct Prepared {
    virtual ~Prepared() = default;
    torch::Tensor image;  // [H, W, 3] uint8 RGB, CPU
  };

  virtual ~OpticalFlow() = default;

  // What it is and how it is set, for people: "RAFT (small), 12 iterations".
  virtual std::string Name() const = 0;

  // Text that differs where the flow of the same images would: the name, and a digest of weights.
  virtual std::string Identity() const { return Name(); }

  // Whether the flow of neighbouring frames is better from a guess. Where not, that of the images alone serves every
  // purpose and need be computed but once.
  virtual bool GainsFromGuess() const { return true; }

  // from, to [H, W, 3] uint8 RGB, CPU -> [H, W, 2] float32. May be called from several threads at once.
  // Throws ShapeError unless both images have the same size.
  virtual torch::Tensor Flow(const torch::Tensor& from, const torch::Tensor& to) const = 0;

  // The same with a guess [H, W, 2] float32 to begin from, such as StillFlow (still_flow.h): what is left to be found
  // may then be far smaller than what the camera causes. By default the guess is not looked at.
  virtual torch::Tensor FlowFrom(const torch::Tensor& from, const torch::Tensor& to, const torch::Tensor& guess) const {
    CheckGuess(from, guess);
    return Flow(from, to);
  }

  // The same in two steps, for images that stand in several pairs. `from` and `to` are this object's own; the guess may
  // be undefined.
  virtual std::shared_ptr<const Prepared> Prepare(const torch::Tensor& image) const;
  virtual torch::Tensor FlowBetween(const Prepared& from, const Prepared& to, const torch::Tensor& guess) const;

 protected:
  static void CheckImages(const torch::Tensor& from, const torch::Tensor& to);    // throws ShapeError, DataError
  static void CheckGuess(const torch::Tensor& from, const torch::Tensor& guess);  // throws ShapeError
};

// Dense inverse search (Kroeger et al., ECCV 2016) with variational refinement, as OpenCV implements it. Patches are
// matched down to full resolution, because at 320 pixels across every halving costs thin parts. The result does not
// depend on the number of threads. Images under 16 pixels a side throw DataError.
class DisFlow : public OpticalFlow {
 public:
  std::string Name() const override { return "DIS"; }
  torch::Tensor Flow(const torch::Tensor& from, const torch::Tensor& to) const override;
  torch::Tensor FlowFrom(const torch::Tensor& from, const torch::Tensor& to, const torch::Tensor& guess) const override;

 private:
  static torch::Tensor Search(const torch::Tensor& from, const torch::Tensor& to, const torch::Tensor& guess);
};

}  // namespace editnerf
