#include "libeditnerf/kernels/fused_mlp.h"

#include <torch/autograd.h>
#include <torch/types.h>
#include <torch/utils.h>

#include "libeditnerf/base/error.h"
#include "tests/catch.h"
#include "tests/kernels/each_target.h"

using namespace editnerf;

namespace {

MlpLayers RandomLayers(const std::vector<int64_t>& widths, bool linear_output) {
  MlpLayers layers;
  layers.linear_output = linear_output;
  for (size_t l = 0; l + 1 < widths.size(); ++l) {
    layers.weights.push_back((torch::randn({widths[l + 1], widths[l]}) / std::sqrt(widths[l])).requires_grad_());
    layers.biases.push_back((torch::randn({widths[l + 1]}) * 0.1).requires_grad_());
  }
  return layers;
}

double RelativeDifference(const torch::Tensor& found, const torch::Tensor& expected) {
  return (found - expected).norm().item<double>() / std::max(expected.norm().item<double>(), 1e-12);
}

void CheckAgainstReference(const std::vector<int64_t>& widths, int64_t samples, bool linear_output) {
  INFO(widths.size() << " widths, first " << widths[0] << ", " << samples << " samples, linear " << linear_output);
  const MlpLayers layers = RandomLayers(widths, linear_output);
  const int64_t first = std::max<int64_t>(widths[0] / 2, 1);
  std::vector<torch::Tensor> inputs = {torch::randn({samples, first}).requires_grad_()};
  if (widths[0] > first) inputs.push_back(torch::randn({samples, widths[0] - first}).requires_grad_());
  const auto upstream = torch::randn({samples, widths.back()});
  std::vector<torch::Tensor> leaves = inputs;
  leaves.insert(leaves.end(), layers.weights.begin(), layers.weights.end());
  leaves.insert(leaves.end(), layers.biases.begin(), layers.biases.end());

  const auto fused = FusedMlp(inputs, layers), plain = MlpReference(inputs, layers);
  REQUIRE(fused.sizes() == plain.sizes());
  CHECK(RelativeDifference(fused, plain) < 1e-5);
  const auto fused_grads = torch::autograd::grad({(fused * upstream).sum()}, leaves);
  const auto plain_grads = torch::autograd::grad({(plain * upstream).sum()}, leaves);
  for (size_t i = 0; i < leaves.size(); ++i) {
    REQUIRE(fused_grads[i].sizes() == plain_grads[i].sizes());
    CHECK(RelativeDifference(fused_grads[i], plain_grads[i]) < 1e-5);
  }
}

}  // namespace

TEST_CASE("fused mlp agrees with its reference in value and every gradient") {
  torch::manual_seed(1);
  for (const int64_t samples : {1, 5, 95, 96, 97, 1000}) {
    CheckAgainstReference({35, 64, 64, 16}, samples, true);
    CheckAgainstReference({31, 64, 3}, samples, true);
    CheckAgainstReference({7, 20, 33}, samples, false);
    CheckAgainstReference({1, 1}, samples, true);
    CheckAgainstReference({3, 128, 130, 2}, samples, true);
  }
}

TEST_CASE("fused mlp agrees with its reference for odd numbers of samples, for every instruction set") {
  ForEachTarget([] {
    torch::manual_seed(3);
    for (const int64_t samples : {0, 1, 7, 63, 65, 97}) {
      CheckAgainstReference({35, 64, 64, 16}, samples, true);
      CheckAgainstReference({7, 20, 33}, samples, false);
      CheckAgainstReference({1, 1}, samples, true);
    }
  });
}

TEST_CASE("fused mlp gives inputs that need no gradient none") {
  const MlpLayers layers = RandomLayers({6, 16, 2}, true);
  const auto fixed = torch::randn({10, 4});
  const auto moved = torch::randn({10, 2}).requires_grad_();
  FusedMlp({fixed, moved}, layers).sum().backward();
  CHECK_FALSE(fixed.grad().defined());
  CHECK(moved.grad().abs().sum().item<double>() > 0);
}

TEST_CASE("fused mlp of no samples is empty and leaves zero gradients") {
  const MlpLayers layers = RandomLayers({6, 16, 2}, true);
  const auto out = FusedMlp({torch::zeros({0, 6})}, layers);
  CHECK(out.sizes() == torch::IntArrayRef{0, 2});
  out.sum().backward();
  CHECK(layers.weights[0].grad().abs().sum().item<double>() == 0);
}

TEST_CASE("fused mlp reads tensors that are not contiguous") {
  torch::manual_seed(2);
  const MlpLayers layers = RandomLayers({6, 16, 2}, true);
  const auto x = torch::randn({6, 40}).t();
  CHECK(RelativeDifference(FusedMlp({x}, layers), MlpReference({x}, layers)) < 1e-5);
}

TEST_CASE("fused mlp refuses widths that do not fit") {
  const MlpLayers layers = RandomLayers({6, 16, 2}, true);
  CHECK_THROWS_AS(FusedMlp({torch::zeros({3, 5})}, layers), ShapeError);
  CHECK_THROWS_AS(FusedMlp({torch::zeros({3, 4}), torch::zeros({2, 2})}, layers), ShapeError);
  CHECK_FALSE(CanFuseMlp({torch::zeros({3, 6}, torch::kFloat64)}, layers));
}
