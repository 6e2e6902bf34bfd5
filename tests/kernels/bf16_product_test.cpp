#include "libeditnerf/kernels/bf16_product.h"

#include <torch/types.h>
#include <torch/utils.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <vector>

#include "libeditnerf/kernels/tile_mlp.h"
#include "tests/catch.h"
#include "tests/kernels/tile_rows.h"

using namespace editnerf;

namespace {

std::vector<Bf16Unit> UnitsHere() {
  std::vector<Bf16Unit> units = Bf16UnitsHere();
  if (units.empty()) WARN("this processor has no bfloat16 products: skipped");
  return units;
}

torch::Tensor Rounded(const torch::Tensor& values) { return values.to(torch::kBFloat16).to(torch::kFloat64); }

double RelativeDifference(const torch::Tensor& found, const torch::Tensor& expected) {
  return (found.to(torch::kFloat64) - expected).norm().item<double>() / std::max(expected.norm().item<double>(), 1e-9);
}

struct Network {
  MlpLayers layers;
  std::vector<int64_t> widths;
};

Network RandomNetwork(const std::vector<int64_t>& widths) {
  Network network{{}, widths};
  for (size_t l = 0; l + 1 < widths.size(); ++l) {
    network.layers.weights.push_back(torch::randn({widths[l + 1], widths[l]}) /
                                     std::sqrt(static_cast<double>(widths[l])));
    network.layers.biases.push_back(0.3 * torch::randn({widths[l + 1]}));
  }
  return network;
}

}  // namespace

TEST_CASE("numbers are rounded to bfloat16 as LibTorch rounds them") {
  torch::manual_seed(1);
  const auto values = torch::cat({torch::randn({1000}), torch::randn({100}) * 1e-39, torch::randn({100}) * 3e38,
                                  torch::tensor({0.0F, -0.0F, INFINITY, -INFINITY, 1.00390625F, 1.01171875F})});
  const auto expected = values.to(torch::kBFloat16).to(torch::kFloat32);
  for (int64_t i = 0; i < values.numel(); ++i) {
    REQUIRE(FromBf16(ToBf16(values[i].item<float>())) == expected[i].item<float>());
  }
  CHECK(std::isnan(FromBf16(ToBf16(std::numeric_limits<float>::quiet_NaN()))));
  CHECK(std::isnan(FromBf16(ToBf16(-std::numeric_limits<float>::signaling_NaN()))));
}

TEST_CASE("networks in bfloat16 are those of rounded weights and activations, for any widths and numbers of samples") {
  torch::manual_seed(2);
  for (const Bf16Unit unit : UnitsHere()) {
    for (const std::vector<int64_t>& widths :
         {std::vector<int64_t>{1, 1}, {3, 17, 2}, {31, 64, 64, 3}, {51, 64, 16}, {27, 32, 32, 8}, {70, 130, 33}}) {
      for (const int64_t count : {1, 7, 16, 31, 32, 33, 63, 65, 127, 128}) {
        INFO(NameOf(unit) << ", " << widths.front() << " to " << widths.back() << ", " << count << " samples");
        const Network network = RandomNetwork(widths);
        const TileMlp mlp(network.layers, unit);
        const auto input = torch::randn({widths.front(), count});
        const TileMemory in = TileOf(input);
        TileMemory activations(mlp.activation_rows());
        mlp.Forward(in.rows(), count, activations.rows());

        auto expected = input;
        for (size_t l = 0; l < network.layers.weights.size(); ++l) {
          expected = Rounded(network.layers.weights[l]).mm(Rounded(expected)) +
                     network.layers.biases[l].to(torch::kFloat64).unsqueeze(1);
          if (l + 1 < network.layers.weights.size()) expected = expected.relu();
          expected = expected.to(torch::kFloat32);
        }
        // A sum that falls on the other side of a rounding boundary moves by a 256th of itself.
        CHECK(RelativeDifference(RowsOf(activations.Row(mlp.output_row()), widths.back(), count),
                                 expected.to(torch::kFloat64)) < (widths.size() > 2 ? 1e-3 : 1e-6));
      }
    }
  }
}

TEST_CASE("networks in two parts of bfloat16 are as exact as sixteen bits, for any widths and numbers of samples") {
  torch::manual_seed(5);
  for (const Bf16Unit unit : UnitsHere()) {
    for (const std::vector<int64_t>& widths : {std::vector<int64_t>{1, 1}, {27, 32, 32, 2}, {31, 64, 64, 3}}) {
      for (const int64_t count : {1, 31, 33, 128}) {
        INFO(NameOf(unit) << ", " << widths.front() << " to " << widths.back() << ", " << count << " samples");
        const Network network = RandomNetwork(widths);
        const TileMlp mlp(network.layers, unit, /*exact=*/true);
        const auto input = torch::randn({widths.front(), count});
        const TileMemory in = TileOf(input);
        for (const bool keep_hidden : {false, true}) {
          TileMemory activations(mlp.activation_rows());
          mlp.Forward(in.rows(), count, activations.rows(), keep_hidden);
          const auto expected = MlpReference({input.t().contiguous()}, network.layers).t().to(torch::kFloat64);
          CHECK(RelativeDifference(RowsOf(activations.Row(mlp.output_row()), widths.back(), count), expected) < 5e-5);
        }
      }
    }
  }
}

TEST_CASE("gradients in bfloat16 are those of float32 but for rounding, for any widths and numbers of samples") {
  torch::manual_seed(3);
  for (const Bf16Unit unit : UnitsHere()) {
    for (const std::vector<int64_t>& widths :
         {std::vector<int64_t>{5, 40}, {3, 17, 2}, {31, 64, 64, 3}, {51, 64, 16}, {27, 32, 32, 8}, {70, 130, 33}}) {
      for (const int64_t count : {1, 31, 33, 128}) {
        INFO(NameOf(unit) << ", " << widths.front() << " to " << widths.back() << ", " << count << " samples");
        Network network = RandomNetwork(widths);
        const auto input = torch::randn({widths.front(), count}), grad = torch::randn({widths.back(), count});
        const TileMemory in = TileOf(input), out_grad = TileOf(grad);
        const auto run = [&](const TileMlp& mlp) {
          TileMemory activations(mlp.activation_rows()), scratch(mlp.scratch_rows());
          mlp.Forward(in.rows(), count, activations.rows());
          TileMlpSums sums = mlp.MakeSums();
          TileMemory to_input(widths.front());
          const int64_t some = (widths.front() + 1) / 2;
          const InputGradient parts[] = {{0, some, to_input.Row(0)}, {some, widths.front() - some, to_input.Row(some)}};
          mlp.Backward(in.rows(), activations.rows(), out_grad.rows(), count, scratch.rows(), sums,
                       c10::ArrayRef<InputGradient>(parts, widths.front() > some ? 2 : 1));
          std::vector<torch::Tensor> gradients = {RowsOf(to_input.rows(), widths.front(), count)};
          for (size_t l = 0; l < network.layers.weights.size(); ++l) {
            gradients.push_back(torch::zeros_like(network.layers.weights[l]));
            gradients.push_back(torch::zeros_like(network.layers.biases[l]));
            mlp.AddSums(sums, l, gradients[gradients.size() - 2].data_ptr<float>(), gradients.back().data_ptr<float>());
          }
          return gradients;
        };
        const auto exact = run(TileMlp(network.layers)), rounded = run(TileMlp(network.layers, unit));
        for (size_t i = 0; i < exact.size(); ++i) {
          // Mostly units that fall on the other side of their ReLU.
          CHECK(RelativeDifference(rounded[i], exact[i].to(torch::kFloat64)) < 0.1);
        }
      }
    }
  }
}

TEST_CASE("a NaN goes through a network in bfloat16, and stays in its sample") {
  torch::manual_seed(4);
  for (const Bf16Unit unit : UnitsHere()) {
    const Network network = RandomNetwork({6, 20, 3});
    const TileMlp mlp(network.layers, unit);
    auto input = torch::randn({6, 40});
    input[2][17] = NAN;
    const TileMemory in = TileOf(input);
    TileMemory activations(mlp.activation_rows());
    mlp.Forward(in.rows(), 40, activations.rows());
    const auto is_nan = RowsOf(activations.Row(mlp.output_row()), 3, 40).isnan();
    CHECK(is_nan.select(1, 17).all().item<bool>());
    CHECK(is_nan.sum().item<int64_t>() == 3);
  }
}
