#include "libeditnerf/field/weight_network.h"

#include <torch/types.h>
#include <torch/utils.h>

#include <cmath>

#include "tests/catch.h"
#include "tests/gradient_check.h"

using namespace editnerf;

namespace {

WeightNetwork Randomised(int64_t num_key_points) {
  WeightNetworkConfig config;
  config.depth = 2;
  config.width = 8;
  config.num_octaves = 2;
  config.output_init = 1;
  WeightNetwork network(config, num_key_points);
  network->to(torch::kFloat64);
  return network;
}

}  // namespace

TEST_CASE("the weights start equal, are positive and sum to one") {
  for (const int64_t count : {2, 3, 64}) {
    WeightNetwork network(WeightNetworkConfig(), count);
    const auto weights = network->forward(torch::rand({10, 3}) - 0.5);
    CHECK(weights.sizes() == torch::IntArrayRef({10, count}));
    CHECK((weights - 1.0 / static_cast<double>(count)).abs().max().item<double>() < 1e-3);
    CHECK(weights.sum(-1).allclose(torch::ones({10})));
  }
}

TEST_CASE("the weights are the softmax of the perceptron over the encoded point") {
  torch::manual_seed(11);
  auto network = Randomised(3);
  const auto x = torch::randn({2, 4, 3}, torch::kFloat64);
  auto p = network->named_parameters();
  auto h = PositionalEncoding(3, 2).forward(x);
  h = torch::relu(h.matmul(p["mlp.hidden0.weight"].t()) + p["mlp.hidden0.bias"]);
  h = torch::relu(h.matmul(p["mlp.hidden1.weight"].t()) + p["mlp.hidden1.bias"]);
  const auto logits = h.matmul(p["mlp.output.weight"].t()) + p["mlp.output.bias"];
  const auto weights = network->forward(x);
  for (int64_t i = 0; i < 2; ++i) {
    for (int64_t j = 0; j < 4; ++j) {
      double sum = 0;
      for (int64_t n = 0; n < 3; ++n) sum += std::exp(logits[i][j][n].item<double>());
      for (int64_t n = 0; n < 3; ++n) {
        CHECK(weights[i][j][n].item<double>() == Approx(std::exp(logits[i][j][n].item<double>()) / sum));
      }
    }
  }
}

TEST_CASE("the weight network has the gradients of its formula") {
  torch::manual_seed(13);
  auto network = Randomised(4);
  const auto x = Leaf(torch::randn({5, 3}));
  std::vector<torch::Tensor> leaves = network->parameters();
  leaves.push_back(x);
  CHECK(GradientError([&] { return network->forward(x); }, leaves) < 1e-6);
}

TEST_CASE("the weights are stable for logits up to 1e4 and 64 key points") {
  for (const auto dtype : {torch::kFloat32, torch::kFloat64}) {
    auto network = Randomised(64);
    network->to(dtype);
    auto bias = network->named_parameters()["mlp.output.bias"];
    {
      const torch::NoGradGuard no_grad;
      bias.copy_(torch::linspace(-1e4, 1e4, 64));
    }
    const auto weights = network->forward(torch::randn({8, 3}, dtype));
    CHECK(weights.isfinite().all().item<bool>());
    CHECK(weights.sum(-1).allclose(torch::ones({8}, dtype)));
    CHECK(weights.select(-1, 63).min().item<double>() > 0.999);
    weights.square().sum().backward();
    for (const auto& parameter : network->parameters()) CHECK(parameter.grad().isfinite().all().item<bool>());
  }
}

TEST_CASE("a weight network for one key point is refused, as are wrong shapes") {
  CHECK_THROWS_WITH(WeightNetwork(WeightNetworkConfig(), 1),
                    "weight network: num_key_points: expected 2 or more, found 1");
  CHECK_THROWS_WITH(Randomised(2)->forward(torch::zeros({4, 2}, torch::kFloat64)),
                    "x_canonical: expected a last dimension of 3, found [4, 2]");
}

TEST_CASE("with a distance prior the weights start with the key point whose track is nearest") {
  WeightNetworkConfig config;
  config.distance_prior = 8;
  // Two parts that move along x, one above the other.
  const auto along = torch::linspace(0, 1, 20);
  const auto track = [&](double z) { return torch::stack({along, along * 0, torch::full({20}, z)}, 1); };
  WeightNetwork network(config, 2, torch::stack({track(0), track(0.5)}, 1));
  const auto at = [&](double x, double z) {
    return network->forward(torch::tensor({{x, 0.0, z}}, torch::kFloat32))[0][0].item<double>();
  };
  CHECK(at(0.3, 0.0) > 0.9);
  CHECK(at(0.9, 0.5) < 0.1);
  CHECK(at(0.5, 0.25) == Approx(0.5).margin(1e-3));
  // What a checkpoint brings.
  WeightNetwork loaded(config, 2);
  for (const auto& buffer : network->named_buffers()) loaded->named_buffers()[buffer.key()].copy_(buffer.value());
  const torch::NoGradGuard no_grad;
  for (const auto& item : network->named_parameters()) loaded->named_parameters()[item.key()].copy_(item.value());
  const auto x = torch::rand({5, 3});
  CHECK(loaded->forward(x).equal(network->forward(x)));
}
