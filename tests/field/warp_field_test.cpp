#include "libeditnerf/field/warp_field.h"

#include <torch/types.h>
#include <torch/utils.h>

#include "libeditnerf/geometry/se3.h"
#include "tests/catch.h"
#include "tests/gradient_check.h"

using namespace editnerf;

namespace {

WarpFieldConfig Small() {
  WarpFieldConfig config;
  config.num_octaves = 3;
  config.depth = 3;
  config.width = 8;
  config.skip_layer = 2;
  config.code_dim = 4;
  return config;
}

}  // namespace

TEST_CASE("the paper's warp field has two heads over 128 features and starts at nearly the identity") {
  WarpField warp{WarpFieldConfig()};
  const auto parameters = warp->named_parameters();
  CHECK(parameters["trunk.hidden0.weight"].sizes() == torch::IntArrayRef({128, 3 * 13 + 8}));
  CHECK(parameters["trunk.hidden4.weight"].sizes() == torch::IntArrayRef({128, 128 + 3 * 13 + 8}));
  CHECK(parameters["trunk.hidden5.weight"].sizes() == torch::IntArrayRef({128, 128}));
  CHECK(parameters["rotation.weight"].min().item<double>() >= 0);
  CHECK(parameters["translation.weight"].max().item<double>() <= 1e-4);
  const auto x = torch::rand({16, 3}) - 0.5;
  const auto moved = warp->forward(x, torch::rand({16, 8}) * 0.05, 0.0);
  CHECK((moved - x).abs().max().item<double>() < 0.05);
}

TEST_CASE("the warp field moves every point by the screw motion of its heads") {
  torch::manual_seed(5);
  WarpField warp(Small());
  warp->to(torch::kFloat64);
  {
    const torch::NoGradGuard no_grad;
    for (auto& parameter : warp->parameters()) parameter.normal_();
  }
  const auto x = torch::randn({6, 3}, torch::kFloat64), code = torch::randn({6, 4}, torch::kFloat64);
  auto p = warp->named_parameters();
  const auto encoded = torch::cat({PositionalEncoding(3, 3).forward(x, 1.6), code}, 1);
  auto h = torch::relu(encoded.matmul(p["trunk.hidden0.weight"].t()) + p["trunk.hidden0.bias"]);
  h = torch::relu(h.matmul(p["trunk.hidden1.weight"].t()) + p["trunk.hidden1.bias"]);
  h = torch::relu(torch::cat({h, encoded}, 1).matmul(p["trunk.hidden2.weight"].t()) + p["trunk.hidden2.bias"]);
  const auto w = h.matmul(p["rotation.weight"].t()) + p["rotation.bias"];
  const auto v = h.matmul(p["translation.weight"].t()) + p["translation.bias"];
  CHECK(warp->forward(x, code, 1.6).allclose(ExpSe3(w, v, x), 1e-10, 1e-10));
}

TEST_CASE("the warp field has the gradients of its formula in points, codes and weights") {
  torch::manual_seed(7);
  WarpFieldConfig config = Small();
  config.head_init = 0.5;
  WarpField warp(config);
  warp->to(torch::kFloat64);
  const auto x = Leaf(torch::randn({4, 3})), code = Leaf(torch::randn({4, 4}));
  std::vector<torch::Tensor> leaves = warp->parameters();
  leaves.push_back(x);
  leaves.push_back(code);
  CHECK(GradientError([&] { return warp->forward(x, code); }, leaves, 1e-7) < 1e-5);
}

TEST_CASE("the warp field has finite and correct gradients at zero rotation") {
  torch::manual_seed(9);
  WarpFieldConfig config = Small();
  config.head_init = 0;
  WarpField warp(config);
  warp->to(torch::kFloat64);
  const auto x = Leaf(torch::randn({4, 3})), code = Leaf(torch::randn({4, 4}));
  CHECK(warp->forward(x, code).equal(x));
  std::vector<torch::Tensor> leaves = warp->parameters();
  leaves.push_back(x);
  CHECK(GradientError([&] { return warp->forward(x, code); }, leaves) < 1e-6);
  CHECK(warp->named_parameters()["rotation.weight"].grad().abs().max().item<double>() > 0);
}

TEST_CASE("the warp field refuses wrong shapes") {
  WarpField warp(Small());
  CHECK_THROWS_WITH(warp->forward(torch::zeros({2, 2}), torch::zeros({2, 4})),
                    "x_observed: expected shape [*, 3], found [2, 2]");
  CHECK_THROWS_WITH(warp->forward(torch::zeros({2, 3}), torch::zeros({1, 4})),
                    "warp_code: expected shape [2, 4], found [1, 4]");
}
