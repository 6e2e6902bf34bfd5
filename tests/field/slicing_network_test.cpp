#include "libeditnerf/field/slicing_network.h"

#include <torch/types.h>
#include <torch/utils.h>

#include "tests/catch.h"
#include "tests/gradient_check.h"

using namespace editnerf;

namespace {

SlicingNetworkConfig Small() {
  SlicingNetworkConfig config;
  config.num_octaves = 2;
  config.depth = 3;
  config.width = 8;
  config.skip_layer = 1;
  config.ambient_dim = 2;
  config.output_init = 0.5;
  return config;
}

}  // namespace

TEST_CASE("the paper's slice starts flat, in three ambient coordinates") {
  SlicingNetwork slice(SlicingNetworkConfig(), 8);
  CHECK(slice->named_parameters()["mlp.hidden4.weight"].sizes() == torch::IntArrayRef({64, 64 + 39 + 8}));
  const auto ambient = slice->forward(torch::rand({10, 3}), torch::rand({10, 8}));
  CHECK(ambient.sizes() == torch::IntArrayRef({10, 3}));
  CHECK(ambient.abs().max().item<double>() < 1e-3);
}

TEST_CASE("the slice is the perceptron over the encoded point and the code") {
  torch::manual_seed(15);
  SlicingNetwork slice(Small(), 4);
  slice->to(torch::kFloat64);
  const auto x = torch::randn({6, 3}, torch::kFloat64), code = torch::randn({6, 4}, torch::kFloat64);
  auto p = slice->named_parameters();
  const auto input = torch::cat({PositionalEncoding(3, 2).forward(x), code}, 1);
  auto h = torch::relu(input.matmul(p["mlp.hidden0.weight"].t()) + p["mlp.hidden0.bias"]);
  h = torch::relu(torch::cat({h, input}, 1).matmul(p["mlp.hidden1.weight"].t()) + p["mlp.hidden1.bias"]);
  h = torch::relu(h.matmul(p["mlp.hidden2.weight"].t()) + p["mlp.hidden2.bias"]);
  CHECK(slice->forward(x, code).allclose(h.matmul(p["mlp.output.weight"].t()) + p["mlp.output.bias"]));
}

TEST_CASE("the slicing network has the gradients of its formula") {
  torch::manual_seed(17);
  SlicingNetwork slice(Small(), 4);
  slice->to(torch::kFloat64);
  const auto x = Leaf(torch::randn({4, 3})), code = Leaf(torch::randn({4, 4}));
  std::vector<torch::Tensor> leaves = slice->parameters();
  leaves.push_back(x);
  leaves.push_back(code);
  CHECK(GradientError([&] { return slice->forward(x, code); }, leaves) < 1e-6);
}

TEST_CASE("the slicing network refuses wrong shapes") {
  SlicingNetwork slice(Small(), 4);
  CHECK_THROWS_WITH(slice->forward(torch::zeros({2, 3}), torch::zeros({2, 8})),
                    "warp_code: expected shape [2, 4], found [2, 8]");
  CHECK_THROWS_WITH(SlicingNetwork(Small(), 0), "slicing network: code_dim: expected 1 or more, found 0");
}
