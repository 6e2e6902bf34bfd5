#include "libeditnerf/kernels/hash_encoding.h"

#include <torch/autograd.h>
#include <torch/types.h>
#include <torch/utils.h>

#include <algorithm>
#include <cmath>
#include <cstring>
#include <limits>

#include "libeditnerf/base/error.h"
#include "libeditnerf/kernels/bf16_table.h"
#include "tests/catch.h"
#include "tests/gradient_check.h"
#include "tests/kernels/each_target.h"

using namespace editnerf;

namespace {

const std::vector<int64_t> kResolutions = HashResolutions(5, 4, 200);  // dense and hashed levels

torch::Tensor Table(torch::Dtype dtype, int64_t features = 2) {
  torch::manual_seed(3);
  return torch::randn({5, 1 << 10, features}, dtype);
}

}  // namespace

TEST_CASE("hash resolutions grow geometrically between both ends") {
  CHECK(HashResolutions(3, 4, 64) == std::vector<int64_t>{4, 16, 64});
  CHECK(HashResolutions(1, 4, 64) == std::vector<int64_t>{4});
}

TEST_CASE("hash encoding agrees with its reference in value and gradient for odd sizes") {
  for (const int64_t features : {1, 2, 4, 8}) {
    for (const int64_t count : {0, 1, 7, 63, 65, 600}) {
      auto table = Table(torch::kFloat64, features).requires_grad_();
      auto x = (torch::rand({count, 3}, torch::kFloat64) * 1.2 - 0.1).requires_grad_();
      const auto upstream = torch::randn({count, 5 * features}, torch::kFloat64);
      const auto fast = HashEncode(x, table, kResolutions), plain = HashEncodeReference(x, table, kResolutions);
      REQUIRE(fast.sizes() == plain.sizes());
      CHECK(torch::allclose(fast, plain, 1e-12, 1e-12));
      const auto fast_grads = torch::autograd::grad({(fast * upstream).sum()}, {x, table});
      const auto plain_grads = torch::autograd::grad({(plain * upstream).sum()}, {x, table});
      CHECK(torch::allclose(fast_grads[0], plain_grads[0], 1e-10, 1e-10));
      CHECK(torch::allclose(fast_grads[1], plain_grads[1], 1e-10, 1e-10));
    }
  }
}

TEST_CASE("hash encoding has the gradient that central differences find") {
  const auto table = Leaf(Table(torch::kFloat64)), x = Leaf(0.1 + 0.8 * torch::rand({20, 3}));
  CHECK(GradientError([&] { return HashEncode(x, table, kResolutions); }, {x, table}, 1e-7) < 1e-5);
}

TEST_CASE("hash encoding is continuous across cells and clamps outside the cube") {
  const auto table = Table(torch::kFloat64);
  const auto at = [&](double u) { return HashEncode(torch::full({1, 3}, u, torch::kFloat64), table, kResolutions); };
  CHECK(torch::allclose(at(0.25 - 1e-12), at(0.25 + 1e-12), 0, 1e-8));
  CHECK(torch::equal(at(1.0), at(7.5)));
  CHECK(torch::equal(at(0.0), at(-1e30)));
  CHECK(torch::equal(at(0.0), at(std::numeric_limits<double>::quiet_NaN())));
  CHECK(at(std::numeric_limits<double>::infinity()).isfinite().all().item<bool>());
}

TEST_CASE("hash encoding in single precision stays near double precision") {
  const auto x = torch::rand({500, 3}, torch::kFloat64);
  const auto wide = HashEncode(x, Table(torch::kFloat64), kResolutions);
  const auto narrow = HashEncode(x.to(torch::kFloat32), Table(torch::kFloat64).to(torch::kFloat32), kResolutions);
  CHECK((wide - narrow.to(torch::kFloat64)).abs().max().item<double>() < 1e-3);
}

TEST_CASE("hash encoding refuses wrong shapes by name") {
  const auto table = Table(torch::kFloat32);
  CHECK_THROWS_WITH(HashEncode(torch::zeros({4, 2}), table, kResolutions),
                    "hash encoding x: expected shape [*, 3], found [4, 2]");
  CHECK_THROWS_WITH(HashEncode(torch::zeros({4, 3}), torch::zeros({5, 12, 2}), kResolutions),
                    "hash encoding table: expected a power of two of entries, found 12");
  CHECK_THROWS_AS(HashEncode(torch::zeros({4, 3}, torch::kFloat64), table, kResolutions), ShapeError);
}

TEST_CASE("the float32 kernel of the hash encoding agrees with the reference, also where the table wraps around") {
  torch::manual_seed(5);
  const std::vector<int64_t> resolutions = HashResolutions(5, 4, 200);
  auto table = torch::randn({5, 1 << 5, 2}).requires_grad_();  // small, so that neighbours wrap around often
  for (const int64_t count : {1, 127, 128, 129, 1000}) {
    auto x = (torch::rand({count, 3}) * 1.2 - 0.1).requires_grad_();
    const auto upstream = torch::randn({count, 10});
    const auto fast = HashEncode(x, table, resolutions), plain = HashEncodeReference(x, table, resolutions);
    CHECK(torch::allclose(fast, plain, 1e-4, 1e-5));
    const auto fast_grads = torch::autograd::grad({(fast * upstream).sum()}, {x, table});
    const auto plain_grads = torch::autograd::grad({(plain * upstream).sum()}, {x, table});
    CHECK((fast_grads[0] - plain_grads[0]).norm().item<double>() < 1e-5 * plain_grads[0].norm().item<double>());
    CHECK((fast_grads[1] - plain_grads[1]).norm().item<double>() < 1e-5 * plain_grads[1].norm().item<double>());
  }
}

TEST_CASE("the float32 kernel of the hash encoding agrees with the reference for every instruction set") {
  const std::vector<int64_t> resolutions = HashResolutions(5, 4, 60);
  const auto close = [](const torch::Tensor& found, const torch::Tensor& expected) {
    return (found - expected).norm().item<double>() <= 1e-5 * expected.norm().item<double>();
  };
  // The corners, and the middles of edges and faces, and the middle.
  const auto ends = torch::linspace(0, 1, 3);
  const auto at_cube = torch::cartesian_prod({ends, ends, ends});
  ForEachTarget([&] {
    torch::manual_seed(7);
    for (const int64_t table_size : {1 << 5, 1 << 10}) {
      for (const int64_t count : {0, 1, 7, 63, 65}) {
        INFO(table_size << " entries, " << count << " samples");
        const auto table = torch::randn({5, table_size, 2}).requires_grad_();
        auto x = torch::rand({count, 3}) * 1.2 - 0.1;
        const int64_t some = std::min(count / 2, at_cube.size(0));
        x.slice(0, 0, some).copy_(at_cube.slice(0, 0, some));
        x.requires_grad_();
        const auto upstream = torch::randn({count, 10});
        const auto fast = HashEncode(x, table, resolutions), plain = HashEncodeReference(x, table, resolutions);
        REQUIRE(fast.sizes() == plain.sizes());
        CHECK(close(fast, plain));
        const auto fast_grads = torch::autograd::grad({(fast * upstream).sum()}, {x, table});
        const auto plain_grads = torch::autograd::grad({(plain * upstream).sum()}, {x, table});
        CHECK(close(fast_grads[0], plain_grads[0]));
        CHECK(close(fast_grads[1], plain_grads[1]));
      }
    }
  });
}

TEST_CASE("the kernels of tables in bfloat16 see the rounded table, and its changes") {
  torch::manual_seed(6);
  const std::vector<int64_t> resolutions = HashResolutions(5, 4, 200);
  auto table = torch::randn({5, 1 << 5, 2});  // small, so that neighbours wrap around often
  Bf16Table copy;
  ForEachTarget([&] {
    for (const int64_t count : {1, 16, 127, 128}) {
      table.mul_(1.25);  // as an optimiser might
      copy.Refresh(table);
      const auto rounded = table.to(torch::kBFloat16).to(torch::kFloat32);
      const auto x = torch::rand({3, 128});
      const HashPoints points = {count, {x[0].data_ptr<float>(), x[1].data_ptr<float>(), x[2].data_ptr<float>()}};
      for (int64_t level = 0; level < 5; ++level) {
        const HashLevel where = {resolutions[static_cast<size_t>(level)], 1 << 5};
        const float* const features = rounded[level].data_ptr<float>();
        const auto found = torch::zeros({5, 128}), expected = torch::zeros({5, 128}), grad = torch::randn({2, 128});
        const auto row = [](const torch::Tensor& rows, int64_t i) { return rows[i].data_ptr<float>(); };
        float* const found_slope[3] = {row(found, 2), row(found, 3), row(found, 4)};
        float* const expected_slope[3] = {row(expected, 2), row(expected, 3), row(expected, 4)};
        EncodeHashLevel(points, where, features, row(expected, 0), row(expected, 1));
        SlopeHashLevel(points, where, features, row(grad, 0), row(grad, 1), expected_slope);
        EncodeBf16HashLevel(points, where, copy.Level(level), row(found, 0), row(found, 1));
        SlopeBf16HashLevel(points, where, copy.Level(level), row(grad, 0), row(grad, 1), found_slope);
        CHECK((found - expected).slice(1, 0, count).norm().item<double>() <
              1e-6 * expected.slice(1, 0, count).norm().item<double>());
      }
    }
  });
}

TEST_CASE("the copy of a table in bfloat16 keeps what is not finite") {
  auto table = torch::zeros({1, 4, 2});
  table[0][1][0] = NAN;
  table[0][2][1] = -INFINITY;
  table[0][3][0] = 3.4e38;
  Bf16Table copy;
  copy.Refresh(table);
  const auto feature = [&](int64_t entry, int which) {
    const uint32_t bits = which == 0 ? copy.Level(0)[entry] << 16 : copy.Level(0)[entry] & 0xffff0000U;
    float value = 0;
    std::memcpy(&value, &bits, sizeof value);
    return value;
  };
  CHECK(std::isnan(feature(1, 0)));
  CHECK(feature(1, 1) == 0);
  CHECK(feature(2, 1) == -INFINITY);
  CHECK(feature(3, 0) == INFINITY);  // as rounding has it
}
