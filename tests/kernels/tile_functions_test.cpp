#include "libeditnerf/kernels/tile_functions.h"

#include <torch/types.h>
#include <torch/utils.h>

#include <cmath>
#include <limits>

#include "libeditnerf/kernels/tile_layout.h"
#include "tests/catch.h"
#include "tests/kernels/each_target.h"
#include "tests/kernels/tile_rows.h"

using namespace editnerf;

namespace {

torch::Tensor Rows(const TileMemory& tile, int64_t num_rows, int64_t count) {
  return RowsOf(tile.rows(), num_rows, count);
}

}  // namespace

TEST_CASE("samples that are kept move together, across the end of a tile too") {
  torch::manual_seed(1);
  ForEachTarget([] {
    for (const int64_t count : {1, 15, 16, 17, 100, 128}) {
      for (const int64_t at : {int64_t{0}, int64_t{5}, kTile - 17, kTile - 1}) {
        const auto from = torch::rand({3, count});
        const auto keep = (torch::rand({1, count}) > 0.4).to(torch::kFloat32);
        TileMemory source = TileOf(from), mask(1), to(3), next(3);
        for (int64_t s = 0; s < count; ++s) mask.Row(0)[s] = keep[0][s].item<float>();
        const int64_t kept = AppendKept(mask.rows(), source.rows(), count, 3, at, to.rows(), next.rows());
        const auto expected = from.index_select(1, keep[0].nonzero().squeeze(1));
        REQUIRE(kept == expected.size(1));
        for (int64_t r = 0; r < 3; ++r) {
          for (int64_t i = 0; i < kept; ++i) {
            const float found = at + i < kTile ? to.Row(r)[at + i] : next.Row(r)[at + i - kTile];
            REQUIRE(found == expected[r][i].item<float>());
          }
        }
      }
    }
  });
}

TEST_CASE("rows are transposed and summed for any number of samples") {
  torch::manual_seed(2);
  ForEachTarget([] {
    for (const int64_t count : {1, 16, 31, 128}) {
      const auto values = torch::randn({32, count});
      const TileMemory tile = TileOf(values);
      std::vector<float> transposed(static_cast<size_t>(kTile * 32)), sums(32, 1.0F);
      TransposeRows(tile.rows(), 32, PaddedSamples(count), transposed.data(), 32);
      const auto found = torch::from_blob(transposed.data(), {kTile, 32}).slice(0, 0, count);
      CHECK(torch::equal(found, values.t()));
      AddRowSums(tile.rows(), 32, count, sums.data());
      CHECK(torch::allclose(torch::from_blob(sums.data(), {32}), values.sum(1) + 1, 1e-4, 1e-4));
    }
  });
}

TEST_CASE("activations stay finite for large values and pass a NaN on") {
  ForEachTarget([] {
    const float nan = std::numeric_limits<float>::quiet_NaN();
    TileMemory tile = TileOf(torch::tensor({{-1e4F, -20.0F, 0.0F, 20.0F, 1e4F, nan}}));
    TileMemory density(1);
    DensityOf(tile.rows(), 0, 15, 6, density.rows());
    const auto expected = torch::tensor({-15.0F, -15.0F, 0.0F, 15.0F, 15.0F}).exp();
    CHECK(torch::allclose(Rows(density, 1, 5)[0], expected, 1e-5));
    CHECK(std::isnan(density.rows()[5]));
    Sigmoid(1, 6, tile.rows());
    CHECK(torch::allclose(Rows(tile, 1, 5)[0], torch::tensor({0.0F, 2.0611537e-9F, 0.5F, 1.0F, 1.0F}), 1e-5, 1e-12));
    CHECK(std::isnan(tile.rows()[5]));
  });
}

TEST_CASE("every finite coordinate has a finite encoding and gradient") {
  ForEachTarget([] {
    const TileMemory tile = TileOf(torch::tensor({{0.5F, 4.0F, -1e4F, 1e7F, -1e9F, 1e20F, -1e30F, 3e38F}}));
    TileMemory encoded(17), gradient(1);
    EncodeTile(tile.rows(), 1, 8, 1, 8, encoded.rows());
    const auto waves = Rows(encoded, 17, 8).slice(0, 1);
    CHECK(waves.abs().max().item<float>() <= 1.000001F);
    CHECK(waves[1][1].item<float>() == Approx(std::cos(4.0)).margin(1e-6));
    TileMemory upstream = TileOf(torch::ones({17, 8}));
    EncodeTileGradient(encoded.rows(), upstream.rows(), 1, 8, 1, 8, gradient.rows());
    CHECK(torch::isfinite(Rows(gradient, 1, 8)).all().item<bool>());
  });
}

TEST_CASE("softmax over rows is stable and sums to one") {
  torch::manual_seed(3);
  ForEachTarget([] {
    const auto logits = torch::randn({5, 19}) * 50;
    TileMemory tile = TileOf(logits);
    Softmax(5, 19, tile.rows());
    CHECK(torch::allclose(Rows(tile, 5, 19), torch::softmax(logits, 0), 1e-5, 1e-7));
  });
}

TEST_CASE("light along rays is exact for thin and for opaque samples") {
  ForEachTarget([] {
    std::vector<float> tau(16, 0.0F), before(16, 0.0F), light(16), weight(16);
    tau[0] = 1e-12F, tau[1] = 1e-3F, tau[2] = 1e12F, before[3] = 1e12F, tau[3] = 1;
    LightAlongRays(tau.data(), before.data(), 16, light.data(), weight.data());
    CHECK(weight[0] == Approx(1e-12).epsilon(1e-5));
    CHECK(weight[1] == Approx(-std::expm1(-1e-3)).epsilon(1e-5));
    CHECK(weight[2] == 1);
    CHECK(light[3] == 0);  // not e^-80, which a density of 1e6 would make a gradient of
    CHECK(weight[3] == 0);
    before[3] = 79;
    before[4] = std::numeric_limits<float>::quiet_NaN();
    LightAlongRays(tau.data(), before.data(), 16, light.data(), weight.data());
    CHECK(light[3] == Approx(std::exp(-79.0)).epsilon(1e-4));
    CHECK(std::isnan(light[4]));
  });
}
