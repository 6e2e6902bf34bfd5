// One flow that begins from what another finds: learned flow does not lose its way over large motions, dense inverse
// search from there is exact to a fraction of a pixel.
#pragma once

#include <memory>
#include <string>
#include <utility>

#include "libeditnerf/tracking/optical_flow.h"

namespace editnerf {

class FlowFromFlow : public OpticalFlow {
 public:
  FlowFromFlow(std::unique_ptr<OpticalFlow> first, std::unique_ptr<OpticalFlow> second)
      : first_(std::move(first)), second_(std::move(second)) {}

  std::string Name() const override { return second_->Name() + " from " + first_->Name(); }
  std::string Identity() const override { return second_->Identity() + " from " + first_->Identity(); }
  bool GainsFromGuess() const override { return first_->GainsFromGuess(); }

  torch::Tensor Flow(const torch::Tensor& from, const torch::Tensor& to) const override {
    return second_->FlowFrom(from, to, first_->Flow(from, to));
  }
  torch::Tensor FlowFrom(const torch::Tensor& from, const torch::Tensor& to,
                         const torch::Tensor& guess) const override {
    return second_->FlowFrom(from, to, first_->FlowFrom(from, to, guess));
  }

  std::shared_ptr<const Prepared> Prepare(const torch::Tensor& image) const override {
    auto both = std::make_shared<Both>();
    both->image = image;
    both->first = first_->Prepare(image);
    both->second = second_->Prepare(image);
    return both;
  }
  torch::Tensor FlowBetween(const Prepared& from, const Prepared& to, const torch::Tensor& guess) const override {
    const auto &a = dynamic_cast<const Both&>(from), &b = dynamic_cast<const Both&>(to);
    return second_->FlowBetween(*a.second, *b.second, first_->FlowBetween(*a.first, *b.first, guess));
  }

 private:
  struct Both : Prepared {
    std::shared_ptr<const Prepared> first, second;
  };
  std::unique_ptr<OpticalFlow> first_, second_;
};

}  // namespace editnerf
