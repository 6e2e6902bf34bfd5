// Optical flow by RAFT (raft/network.h) as one of the library's flows.
#pragma once

#include <torch/types.h>

#include <cstdint>
#include <memory>
#include <string>

#include "libeditnerf/tracking/optical_flow.h"
#include "libeditnerf/tracking/raft/network.h"

namespace editnerf {

struct RaftFlowOptions {
  int64_t iterations = 12;  // >= 1
  int64_t enlarge = 1;  // whole factor, >= 1, by which images are enlarged first: RAFT works at an eighth of the size
};

// Images are enlarged (bicubic), then padded by repeated borders to multiples of 8, half on each side, as the authors
// do for whole video frames. Images under 16 pixels a side throw DataError.
class RaftFlow : public OpticalFlow {
 public:
  RaftFlow(Raft network, const RaftFlowOptions& options);  // throws ConfigError

  std::string Name() const override;
  std::string Identity() const override;  // with a digest of all weights
  bool GainsFromGuess() const override { return false; }
  torch::Tensor Flow(const torch::Tensor& from, const torch::Tensor& to) const override;

  // The guess is averaged over each place of the network.
  torch::Tensor FlowFrom(const torch::Tensor& from, const torch::Tensor& to, const torch::Tensor& guess) const override;

  // The encoders' part, a fifth to a quarter of a pair's work for each image.
  std::shared_ptr<const Prepared> Prepare(const torch::Tensor& image) const override;
  torch::Tensor FlowBetween(const Prepared& from, const Prepared& to, const torch::Tensor& guess) const override;

 private:
  mutable Raft network_;  // inference changes nothing in it
  RaftFlowOptions options_;
};

}  // namespace editnerf
