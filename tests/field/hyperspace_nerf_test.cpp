#include "libeditnerf/field/hyperspace_nerf.h"

#include <torch/types.h>
#include <torch/utils.h>

#include "tests/catch.h"
#include "tests/gradient_check.h"

using namespace editnerf;

namespace {

HyperspaceNerfConfig Small() {
  HyperspaceNerfConfig config;
  config.num_octaves = 2;
  config.ambient_octaves = 2;
  config.depth = 3;
  config.width = 8;
  config.skip_layer = 2;
  config.color_width = 6;
  config.ambient_window_delay = 100;
  config.ambient_window_steps = 1000;
  return config;
}

HyperspaceInput RandomInput(int64_t count, torch::Dtype dtype) {
  HyperspaceInput input;
  input.x_canonical = torch::randn({count, 3}, dtype);
  input.ambient = torch::randn({count, 3}, dtype);
  input.direction = torch::randn({count, 3}, dtype);
  input.direction = input.direction / input.direction.norm(2, -1, true);
  input.appearance = torch::rand({count, 4}, dtype);
  return input;
}

torch::Tensor Linear(const torch::OrderedDict<std::string, torch::Tensor>& p, const std::string& name,
                     const torch::Tensor& x) {
  return x.matmul(p[name + ".weight"].t()) + p[name + ".bias"];
}

}  // namespace

TEST_CASE("the paper's hyperspace network has the published sizes") {
  HyperspaceNerf network(HyperspaceNerfConfig(), HyperspaceInputs{3, 4, 4});
  const auto p = network->named_parameters();
  CHECK(p["trunk.hidden0.weight"].sizes() == torch::IntArrayRef({256, 51 + 6}));
  CHECK(p["trunk.hidden4.weight"].sizes() == torch::IntArrayRef({256, 256 + 51 + 6}));
  CHECK(p["trunk.hidden7.weight"].sizes() == torch::IntArrayRef({256, 256}));
  CHECK(p["density.weight"].sizes() == torch::IntArrayRef({1, 256}));
  CHECK(p["bottleneck.weight"].sizes() == torch::IntArrayRef({256, 256}));
  CHECK(p["color.hidden0.weight"].sizes() == torch::IntArrayRef({128, 256 + 27 + 4}));
  CHECK(p["color.output.weight"].sizes() == torch::IntArrayRef({3, 128}));
}

TEST_CASE("the hyperspace network is its layers, with density from the trunk alone") {
  torch::manual_seed(19);
  HyperspaceNerf network(Small(), HyperspaceInputs{3, 1, 4});
  network->to(torch::kFloat64);
  network->SetStep(475);  // (475 - 100) / 1000 of two octaves: alpha = 0.75
  const HyperspaceInput input = RandomInput(5, torch::kFloat64);
  const auto p = network->named_parameters();
  const auto encoded = torch::cat({PositionalEncoding(3, 2).forward(input.x_canonical),
                                   PositionalEncoding(3, 2, false).forward(input.ambient, 0.75)},
                                  1);
  auto h = torch::relu(Linear(p, "trunk.hidden0", encoded));
  h = torch::relu(Linear(p, "trunk.hidden1", h));
  h = torch::relu(Linear(p, "trunk.hidden2", torch::cat({h, encoded}, 1)));
  const auto density = torch::log1p(Linear(p, "density", h).exp()).squeeze(1);
  const auto conditions =
      torch::cat({Linear(p, "bottleneck", h), PositionalEncoding(3, 1).forward(input.direction), input.appearance}, 1);
  const auto color = torch::sigmoid(Linear(p, "color.output", torch::relu(Linear(p, "color.hidden0", conditions))));
  const HyperspaceOutput output = network->Evaluate(input);
  CHECK(output.density.allclose(density, 1e-10, 1e-12));
  CHECK(output.radiance.allclose(color, 1e-10, 1e-12));
  HyperspaceInput positions;
  positions.x_canonical = input.x_canonical;
  positions.ambient = input.ambient;
  CHECK(network->Density(positions).equal(output.density));
}

TEST_CASE("the hyperspace network has the gradients of its formula") {
  torch::manual_seed(21);
  HyperspaceNerf network(Small(), HyperspaceInputs{3, 1, 4});
  network->to(torch::kFloat64);
  HyperspaceInput input = RandomInput(4, torch::kFloat64);
  std::vector<torch::Tensor> leaves = network->parameters();
  for (torch::Tensor* tensor : {&input.x_canonical, &input.ambient, &input.direction, &input.appearance}) {
    *tensor = Leaf(*tensor);
    leaves.push_back(*tensor);
  }
  const auto all = [&] {
    const HyperspaceOutput output = network->Evaluate(input);
    return torch::cat({output.density.unsqueeze(1), output.radiance}, 1);
  };
  CHECK(GradientError(all, leaves, 1e-7) < 1e-5);
}

TEST_CASE("the ambient coordinates have no effect until their window opens") {
  HyperspaceNerf network(Small(), HyperspaceInputs{3, {}, 0});
  HyperspaceInput input = RandomInput(6, torch::kFloat32);
  const auto changes = [&] {
    const auto before = network->Density(input);
    HyperspaceInput moved = input;
    moved.ambient = input.ambient + 0.3;
    return !network->Density(moved).equal(before);
  };
  CHECK(changes());
  network->SetStep(100);
  CHECK_FALSE(changes());
  network->SetStep(300);
  CHECK(changes());
}

TEST_CASE("what the colour does not depend on is not built") {
  HyperspaceNerf network(Small(), HyperspaceInputs{0, {}, 0});
  CHECK_FALSE(network->named_parameters().contains("bottleneck.weight"));
  HyperspaceInput input;
  input.x_canonical = torch::randn({4, 3});
  const HyperspaceOutput output = network->Evaluate(input);
  CHECK(output.radiance.sizes() == torch::IntArrayRef({4, 3}));
  CHECK(output.density.sizes() == torch::IntArrayRef({4}));
}

TEST_CASE("extreme pre-activations give finite densities, colours and gradients") {
  HyperspaceNerf network(Small(), HyperspaceInputs{3, 1, 4});
  auto p = network->named_parameters();
  for (const double extreme : {-1e4, 1e4}) {
    {
      const torch::NoGradGuard no_grad;
      p["density.bias"].fill_(extreme);
      p["color.output.bias"].fill_(extreme);
    }
    network->zero_grad();
    const HyperspaceOutput output = network->Evaluate(RandomInput(5, torch::kFloat32));
    CHECK(output.density.isfinite().all().item<bool>());
    CHECK(output.density.min().item<double>() >= 0);
    CHECK(output.radiance.min().item<double>() >= 0);
    CHECK(output.radiance.max().item<double>() <= 1);
    (output.density.sum() + output.radiance.sum()).backward();
    for (const auto& parameter : network->parameters()) CHECK(parameter.grad().isfinite().all().item<bool>());
  }
}

TEST_CASE("the hyperspace network refuses wrong and missing inputs") {
  HyperspaceNerf network(Small(), HyperspaceInputs{3, 1, 4});
  HyperspaceInput input = RandomInput(5, torch::kFloat32);
  input.ambient = torch::zeros({5, 2});
  CHECK_THROWS_WITH(network->Density(input), "ambient: expected shape [5, 3], found [5, 2]");
  input = RandomInput(5, torch::kFloat32);
  input.direction = torch::Tensor();
  CHECK_THROWS_WITH(network->Evaluate(input), "direction: expected shape [5, 3], found undefined");
  input = RandomInput(5, torch::kFloat32);
  input.appearance = torch::zeros({4, 4});
  CHECK_THROWS_WITH(network->Evaluate(input), "appearance: expected shape [5, 4], found [4, 4]");
}
