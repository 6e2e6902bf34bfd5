#include "libeditnerf/field/mlp.h"

#include <torch/types.h>
#include <torch/utils.h>

#include <algorithm>
#include <vector>

#include "libeditnerf/base/error.h"
#include "tests/catch.h"
#include "tests/gradient_check.h"

using namespace editnerf;

namespace {

MlpOptions Options(int64_t skip_layer) {
  MlpOptions options;
  options.in = 3;
  options.depth = 4;
  options.width = 6;
  options.skip_layer = skip_layer;
  options.out = 2;
  return options;
}

std::vector<double> Layer(const torch::Tensor& weight, const torch::Tensor& bias, const std::vector<double>& in) {
  std::vector<double> out;
  for (int64_t row = 0; row < weight.size(0); ++row) {
    double sum = bias[row].item<double>();
    REQUIRE(weight.size(1) == static_cast<int64_t>(in.size()));
    for (size_t column = 0; column < in.size(); ++column) {
      sum += weight[row][static_cast<int64_t>(column)].item<double>() * in[column];
    }
    out.push_back(sum);
  }
  return out;
}

}  // namespace

TEST_CASE("the perceptron is its layers one after the other, with the input again before the skip layer") {
  for (const int64_t skip : {0, 1, 3, 9}) {
    Mlp mlp(Options(skip));
    mlp->to(torch::kFloat64);
    auto parameters = mlp->named_parameters();
    {
      const torch::NoGradGuard no_grad;
      for (auto& item : parameters) item.value().normal_();
    }
    const auto x = torch::randn({3}, torch::kFloat64);
    const std::vector<double> input = {x[0].item<double>(), x[1].item<double>(), x[2].item<double>()};
    std::vector<double> y = input;
    for (int64_t i = 0; i < 4; ++i) {
      if (i > 0 && i == skip) y.insert(y.end(), input.begin(), input.end());
      const std::string name = "hidden" + std::to_string(i);
      y = Layer(parameters[name + ".weight"], parameters[name + ".bias"], y);
      for (double& value : y) value = std::max(value, 0.0);
    }
    y = Layer(parameters["output.weight"], parameters["output.bias"], y);
    const auto found = mlp->forward(x);
    CHECK(found[0].item<double>() == Approx(y[0]).epsilon(1e-12));
    CHECK(found[1].item<double>() == Approx(y[1]).epsilon(1e-12));
  }
}

TEST_CASE("the perceptron has the gradients of its formula, in its input and its weights") {
  torch::manual_seed(3);
  Mlp mlp(Options(2));
  mlp->to(torch::kFloat64);
  const auto x = Leaf(torch::randn({5, 3}));
  std::vector<torch::Tensor> leaves = mlp->parameters();
  {
    // Biases of zero put units whose inputs are all cut off exactly on the kink of the next layer.
    const torch::NoGradGuard no_grad;
    for (torch::Tensor& leaf : leaves) leaf.normal_();
  }
  leaves.push_back(x);
  CHECK(GradientError([&] { return mlp->forward(x); }, leaves) < 1e-6);
}

TEST_CASE("weights start as told and biases at zero") {
  const auto glorot = MakeLinear(30, 50, LayerInit::GlorotUniform())->weight;
  CHECK(glorot.abs().max().item<double>() <= std::sqrt(6.0 / 80));
  CHECK(glorot.abs().max().item<double>() > 0.95 * std::sqrt(6.0 / 80));
  const auto normal = MakeLinear(100, 50, LayerInit::Normal(1e-5));
  CHECK(normal->weight.std().item<double>() == Approx(1e-5).epsilon(0.1));
  CHECK(normal->bias.abs().max().item<double>() == 0);
  const auto uniform = MakeLinear(100, 50, LayerInit::Uniform(1e-4))->weight;
  CHECK(uniform.min().item<double>() >= 0);
  CHECK(uniform.max().item<double>() <= 1e-4);
  CHECK(uniform.mean().item<double>() == Approx(5e-5).epsilon(0.1));
}

TEST_CASE("without outputs the last hidden layer comes out, and wrong sizes are refused") {
  MlpOptions options = Options(2);
  options.out = 0;
  Mlp mlp(options);
  CHECK(mlp->output_dim() == 6);
  CHECK(mlp->forward(torch::randn({7, 3})).min().item<double>() >= 0);
  CHECK_THROWS_WITH(mlp->forward(torch::zeros({7, 4})), "x: expected a last dimension of 3, found [7, 4]");
  options.depth = 0;
  CHECK_THROWS_WITH(Mlp(options), "mlp: depth: expected 1 or more, found 0");
}
