// How far off the training images still are, cell by cell, so that more rays go where there is more left to learn.
#pragma once

#include <torch/types.h>

#include <cstdint>
#include <vector>

namespace editnerf {

// Pixels are counted through all images, row by row. On the CPU.
class ErrorMap {
 public:
  static constexpr int64_t kCell = 8;  // pixels a side

  // For `frames` images, of whose rays `share`, below 1, are drawn here, and the others from all pixels alike. Nothing
  // is known of any cell, and all are alike.
  ErrorMap(int64_t frames, int64_t height, int64_t width, double share);

  // Memory that such a map takes.
  static int64_t Bytes(int64_t frames, int64_t height, int64_t width);

  // What rays through `pixel` [R] int64 have missed their colours by, squared, [R] float32. What a cell is thought to
  // miss follows its last ten rays or so; what is not finite is left out.
  void Learn(const torch::Tensor& pixel, const torch::Tensor& missed);

  // From now on rays are drawn by what has been learnt up to here.
  void Settle();

  // `count` pixels, with repetition, from LibTorch's default generator. A cell's chance is its area by the root of its
  // mean squared error: gradients of rays are as long as that, so they scatter least if each counts by its chance
  // (Katharopoulos and Fleuret, "Not All Samples Are Created Equal", ICML 2018).
  torch::Tensor Draw(int64_t count) const;

  // [R] float32 for pixels [R]: what each ray counts for, so that the mean over rays drawn both ways is that over rays
  // drawn from all pixels alike. At most 1 / (1 - share).
  torch::Tensor Emphasis(const torch::Tensor& pixel) const;

  double share() const { return share_; }

  // What is drawn by and what has been learnt since, [2, F, cells down, cells across] float32. SetState throws
  // ShapeError for another shape, and CheckpointError for what is no squared error.
  torch::Tensor State() const;
  void SetState(const torch::Tensor& state);

 private:
  int64_t CellOf(int64_t pixel) const;

  int64_t frames_, height_, width_, down_, across_;
  double share_;
  std::vector<float> missed_, settled_;  // [F, down, across], mean squared errors
  std::vector<double> up_to_;            // sums of the cells' chances, each with all before it
  double mean_root_ = 0;                 // over all pixels
};

}  // namespace editnerf
