#include "libeditnerf/field/fast_hyperspace.h"

#include <torch/types.h>
#include <torch/utils.h>

#include "libeditnerf/base/error.h"
#include "tests/catch.h"

using namespace editnerf;

namespace {

FastHyperspace SmallField(bool shade, int64_t key_points, std::optional<Vec3> lamp = {}, double along_light = 0.25) {
  torch::manual_seed(1);
  FastHyperspaceOptions options;
  options.config.canonical_hash = options.config.local_hash = {4, 2, 10, 4, 32};
  options.config.shade_hash = {3, 2, 10, 4, 16};
  options.config.shade = shade;
  options.config.shade_along_light = along_light;
  options.lamp = lamp;
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

TEST_CASE("along the light the encoding of shade is longer, and across it as before") {
  const Vec3 lamp = Normalized({0.3, -0.4, 0.8});
  const torch::Tensor to = torch::tensor({lamp.x, lamp.y, lamp.z}).to(torch::kFloat32);
  FastHyperspace quarter = SmallField(true, 2, lamp, 0.25), half = SmallField(true, 2, lamp, 0.5);
  const torch::Tensor x = torch::rand({50, 3}) * 0.2 - 0.1, second = torch::tensor({0.05F, 0.02F, 0.1F});
  HyperspaceInput once = GovernedByFirst(x, second), twice = once;
  // As far across, and twice as far along the light.
  twice.from_keys = once.from_keys + once.from_keys.matmul(to).unsqueeze(2) * to;
  CHECK(torch::allclose(half.Evaluate(once).radiance, quarter.Evaluate(twice).radiance, 1e-4, 1e-5));
  CHECK_FALSE(torch::allclose(half.Evaluate(once).radiance, quarter.Evaluate(once).radiance, 1e-4, 1e-5));
  // Without a lamp the axes are the scene's.
  FastHyperspace plain = SmallField(true, 2, {}, 0.25), other = SmallField(true, 2, {}, 0.5);
  CHECK(torch::equal(plain.Evaluate(once).radiance, other.Evaluate(once).radiance));
}

TEST_CASE("with one key point nothing is cast, as the local encoding sees every place from it") {
  FastHyperspace field = SmallField(/*shade=*/true, 1);
  CHECK(field.named_parameters().find("shade_table") == nullptr);
}
