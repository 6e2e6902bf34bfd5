// A field whose picture is known: a ball of constant density around the state's key point, coloured by where on it the
// sample lies, with the parameter `strength` multiplying its density.
#pragma once

#include <torch/types.h>

#include "libeditnerf/field/radiance_field.h"

namespace editnerf {

class BallField : public RadianceField {
 public:
  explicit BallField(double radius, double density, bool coarse = false)
      : radius_(radius), density_(density), coarse_(coarse) {
    strength_ = register_parameter("strength", torch::ones({}, torch::kFloat64));
  }

  void SetStep(int64_t) override {}
  bool has_coarse_level() const override { return coarse_; }
  FrameStates States(const torch::Tensor&) override { return {}; }

  FieldOutput Evaluate(const FieldInput& input, const FrameStates& states, Level level) override {
    auto output = EvaluateDensity(input, states, level);
    output.radiance = (output.x_canonical / radius_ + 1) / 2;
    return output;
  }

  FieldOutput EvaluateDensity(const FieldInput& input, const FrameStates& states, Level) override {
    evaluations += input.x_observed.size(0);
    FieldOutput output;
    const auto center = states.key_points.select(1, 0).index_select(0, input.state).to(input.x_observed.dtype());
    const auto local = input.x_observed - center;
    const auto inside = (local.norm(2, 1) < radius_).to(local.dtype());
    output.density = inside * (density_ * strength_).to(local.dtype());
    output.x_canonical = local;
    output.ambient = center;
    output.anchor = center;
    return output;
  }

  int64_t evaluations = 0;

 private:
  double radius_, density_;
  bool coarse_;
  torch::Tensor strength_;
};

inline FrameStates BallStates(const torch::Tensor& centers) {  // [F, 3]
  FrameStates states;
  states.key_points = centers.unsqueeze(1);
  return states;
}

}  // namespace editnerf
