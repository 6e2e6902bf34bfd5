#include "libeditnerf/field/fast_hyperspace.h"

#include <torch/torch.h>

#include "libeditnerf/base/error.h"
#include "tests/catch.h"

using namespace editnerf;

namespace {

FastHyperspace SmallField(bool shade, int64_t key_points) {
  torch::manual_seed(1);
  FastHyperspaceOptions options;
  options.config.canonical_hash = options.config.local_hash = {4, 2, 10, 4, 32};
  options.config.shade_hash = {3, 2, 10, 4, 16};
  options.config.shade = shade;
  options.box = {{-1, -1, -1}, {1, 1, 1}};
  options.ambient_dim = 3;
  options.num_key_points = key_points;
  options.use_direction = false;
  FastHyperspace field(options);
  const torch::NoGradGuard no_grad;
  for (const auto& item : field.named_parameters()) {
    if (item.key().find("_table") != std::string::npos) item.value().uniform_(-1, 1);
  }
  return field;
}

// Places that the first key point governs, with the second one where `second` is.
HyperspaceInput GovernedByFirst(const torch::Tensor& x, const torch::Tensor& second) {
  const torch::Tensor first = torch::zeros({3});
  HyperspaceInput input;
  input.x_canonical = x;
  input.ambient = torch::zeros({x.size(0), 3});
  input.local = x - first;
  input.weights = torch::tensor({{1.0F, 0.0F}}).expand({x.size(0), 2});
  input.from_keys = torch::stack({x - first, x - second}, 1);
  return input;
}

}  // namespace

TEST_CASE("what a part casts is seen on places that another key point governs, in colour alone") {
  const torch::Tensor x = torch::rand({50, 3}) * 0.4 - 0.2;
  const torch::Tensor here = torch::tensor({0.1F, 0.1F, 0.0F}), there = torch::tensor({0.1F, 0.2F, 0.1F});
  for (const bool shade : {false, true}) {
    FastHyperspace field = SmallField(shade, 2);
    const HyperspaceOutput before = field.Evaluate(GovernedByFirst(x, here));
    const HyperspaceOutput after = field.Evaluate(GovernedByFirst(x, there));
    CHECK(torch::equal(before.density, after.density));
    CHECK(torch::equal(before.radiance, after.radiance) == !shade);
  }
}

TEST_CASE("what a part casts ends with the cube around its key point") {
  FastHyperspace field = SmallField(/*shade=*/true, 2);
  const torch::Tensor x = torch::rand({50, 3}) * 0.4 - 0.2;
  const torch::Tensor far = torch::tensor({0.9F, 0.9F, 0.9F}), farther = torch::tensor({-0.9F, 0.8F, 0.9F});
  CHECK(torch::equal(field.Evaluate(GovernedByFirst(x, far)).radiance,
                     field.Evaluate(GovernedByFirst(x, farther)).radiance));
  HyperspaceInput input = GovernedByFirst(x, far);
  input.from_keys = torch::zeros({50, 1, 3});
  CHECK_THROWS_AS(field.Evaluate(input), ShapeError);
}

TEST_CASE("with one key point nothing is cast, as the local encoding sees every place from it") {
  FastHyperspace field = SmallField(/*shade=*/true, 1);
  CHECK(field.named_parameters().find("shade_table") == nullptr);
}
