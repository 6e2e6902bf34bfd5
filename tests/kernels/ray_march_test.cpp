#include "libeditnerf/kernels/ray_march.h"

#include <torch/types.h>
#include <torch/utils.h>

#include <limits>

#include "libeditnerf/base/error.h"
#include "libeditnerf/render/occupancy_grid.h"
#include "libeditnerf/render/ray_marcher.h"
#include "tests/catch.h"
#include "tests/kernels/each_target.h"

using namespace editnerf;

namespace {

constexpr double kNear = 0.2, kFar = 3.7;
const Box kBox{{-1, -1.1, -0.9}, {1.2, 1, 1}}, kLocalBox{{-0.6, -0.5, -0.6}, {0.5, 0.6, 0.5}};

// A grid with a random share of its cells occupied.
struct RandomGrid {
  RandomGrid(const Box& box, int64_t resolution, double share) : grid(box, Options(resolution)) {
    const auto buffers = grid.named_buffers();
    bits = {buffers["low"], buffers["high"], buffers["occupied"], resolution};
    bits.occupied.copy_(torch::rand(bits.occupied.sizes()) < share);
  }
  static OccupancyOptions Options(int64_t resolution) {
    OccupancyOptions options;
    options.resolution = resolution;
    return options;
  }
  // Points [..., 3] within 1e-5 cells of a wall.
  torch::Tensor AtWall(const torch::Tensor& x) const {
    const auto cell = (x.to(torch::kFloat64) - bits.low) / (bits.high - bits.low) * bits.resolution;
    return ((cell - cell.round()).abs() < 1e-5).any(-1);
  }

  OccupancyGrid grid;
  OccupancyBits bits;
};

// Rays from within and around the box in all directions, some along an axis or a plane, half of them towards the box.
MarchedRays RandomRays(int64_t count) {
  MarchedRays rays;
  rays.origin = torch::rand({count, 3}) * 4 - 2;
  auto direction = torch::randn({count, 3});
  direction.slice(0, 0, count / 2) = -rays.origin.slice(0, 0, count / 2) + 0.5 * torch::randn({count / 2, 3});
  direction = direction * (torch::rand({count, 3}) < 0.9);
  rays.direction = direction / direction.norm(2, 1, true).clamp_min(1e-3);
  rays.jitter = torch::rand({count});
  rays.anchor = torch::rand({count, 3}) - 0.5;
  return rays;
}

// Whether MarchRays keeps the samples that looking every candidate up keeps, but for those at a wall.
bool AgreesWithLookUps(const MarchedRays& rays, int64_t steps, const RandomGrid& whole, const RandomGrid* local) {
  const int64_t count = rays.origin.size(0);
  const auto t = MarchCandidates(torch::full({count}, kNear), torch::full({count}, kFar), steps, rays.jitter);
  const auto x = rays.origin.unsqueeze(1) + t.unsqueeze(2) * rays.direction.unsqueeze(1);
  auto keep = whole.grid.Occupied(x), at_wall = whole.AtWall(x);
  if (local != nullptr) {
    auto x_local = x - rays.anchor.unsqueeze(1);
    if (rays.turn.defined()) x_local = torch::matmul(x_local, rays.turn.transpose(1, 2));
    keep = keep.logical_and(local->grid.Occupied(x_local));
    at_wall = at_wall.logical_or(local->AtWall(x_local));
  }
  const auto found = MarchRays(rays, kNear, kFar, steps, whole.bits, local != nullptr ? &local->bits : nullptr);
  const auto step = ((found.t - kNear) / ((kFar - kNear) / steps) - rays.jitter.index_select(0, found.ray)).round();
  auto kept = torch::zeros_like(keep);
  kept.index_put_({found.ray, step.to(torch::kInt64)}, true);
  if (!keep.any().item<bool>()) keep[0][0] = true;
  const auto counts = torch::bincount(found.ray, {}, count);
  return kept.ne(keep).logical_and(at_wall.logical_not()).sum().item<int64_t>() == 0 &&
         torch::equal(found.t, t.masked_select(kept)) && torch::equal(found.offsets.diff(), counts) &&
         torch::equal(found.delta, torch::full_like(found.t, (kFar - kNear) / steps));
}

}  // namespace

TEST_CASE("marching keeps the samples that looking up every candidate keeps") {
  torch::manual_seed(1);
  const auto rays = RandomRays(400);
  auto turned = rays;
  turned.turn = std::get<0>(torch::linalg_qr(torch::randn({400, 3, 3})));
  ForEachTarget([&] {
    for (const int64_t resolution : {1, 7, 64}) {
      for (const double share : {0.0, 0.02, 0.5, 1.0}) {
        const RandomGrid whole(kBox, resolution, share), local(kLocalBox, resolution, share);
        for (const int64_t steps : {1, 65, 300}) {
          INFO(resolution << " cells, " << share << " occupied, " << steps << " steps");
          CHECK(AgreesWithLookUps(rays, steps, whole, nullptr));
          CHECK(AgreesWithLookUps(rays, steps, whole, &local));
          CHECK(AgreesWithLookUps(turned, steps, whole, &local));
        }
      }
    }
  });
}

TEST_CASE("marching keeps the samples that looking up every candidate keeps for odd numbers of rays and steps") {
  torch::manual_seed(3);
  const RandomGrid whole(kBox, 7, 0.5), local(kLocalBox, 7, 0.5);
  ForEachTarget([&] {
    for (const int64_t count : {1, 7, 63, 65}) {
      const auto rays = RandomRays(count);
      for (const int64_t steps : {1, 7, 63, 65}) {
        INFO(count << " rays, " << steps << " steps");
        CHECK(AgreesWithLookUps(rays, steps, whole, nullptr));
        CHECK(AgreesWithLookUps(rays, steps, whole, &local));
      }
    }
  });
}

TEST_CASE("marching starts on the lower faces of the box and ends before the upper ones") {
  const RandomGrid grid({{-1, -1, -1}, {1, 1, 1}}, 8, 1);
  MarchedRays rays;
  rays.origin = torch::tensor({{-1.5F, -1.0F, 0.0F}, {-1.5F, 1.0F, 0.0F}, {-1.5F, 0.0F, 1.0F}, {-1.5F, 0.0F, -1.0F}});
  rays.direction = torch::tensor({{1.0F, 0.0F, 0.0F}}).expand({4, 3}).contiguous();
  rays.jitter = torch::full({4}, 0.5F);
  const auto samples = MarchRays(rays, 0.25, 4.25, 16, grid.bits);  // at x = -1.125, -0.875 and so on
  CHECK(torch::equal(samples.offsets, torch::tensor({0, 8, 8, 8, 16}, torch::kInt64)));
  rays.jitter.zero_();  // at x = -1.25, -1 and so on
  const auto on_faces = MarchRays(rays, 0.25, 4.25, 16, grid.bits);
  CHECK(torch::equal(on_faces.offsets, torch::tensor({0, 8, 8, 8, 16}, torch::kInt64)));
  CHECK(on_faces.t[0].item<double>() == 0.5);
  CHECK(on_faces.t[7].item<double>() == 2.25);
}

TEST_CASE("marching keeps nothing of rays that are not finite or miss the box") {
  const float nan = std::numeric_limits<float>::quiet_NaN(), inf = std::numeric_limits<float>::infinity();
  torch::manual_seed(2);
  const RandomGrid grid(kBox, 16, 1);
  auto rays = RandomRays(9);
  rays.origin.zero_();
  for (const float value : {nan, inf, -inf, 1e38f}) {
    auto broken = rays;
    broken.origin = rays.origin.clone();
    broken.origin[1][0] = value;
    broken.origin.select(1, 2).slice(0, 2, 4).fill_(value);
    broken.direction = rays.direction.clone();
    broken.direction[4][1] = value;
    broken.direction[5].fill_(value);
    broken.jitter = rays.jitter.clone();
    broken.jitter[6] = value;
    const auto samples = MarchRays(broken, kNear, kFar, 50, grid.bits);
    CHECK(samples.offsets[1].item<int64_t>() > 0);
    CHECK(samples.offsets[7].item<int64_t>() == samples.offsets[1].item<int64_t>());
    CHECK(samples.offsets[8].item<int64_t>() > samples.offsets[7].item<int64_t>());
  }
}

TEST_CASE("marching through nothing keeps the first sample of the first ray") {
  const RandomGrid grid(kBox, 8, 0);
  const auto rays = RandomRays(5);
  const auto samples = MarchRays(rays, kNear, kFar, 10, grid.bits);
  CHECK(torch::equal(samples.ray, torch::zeros({1}, torch::kInt64)));
  CHECK(torch::equal(samples.offsets, torch::tensor({0, 1, 1, 1, 1, 1}, torch::kInt64)));
  CHECK(samples.t[0].item<double>() == Approx(kNear + 0.35 * rays.jitter[0].item<double>()));
}

TEST_CASE("marching refuses other types and shapes by name") {
  const RandomGrid grid(kBox, 8, 1);
  auto rays = RandomRays(5);
  rays.direction = rays.direction.to(torch::kFloat64);
  CHECK_THROWS_WITH(MarchRays(rays, kNear, kFar, 10, grid.bits),
                    "marching: direction: expected float32 on the CPU, found CPUDoubleType");
  rays = RandomRays(5);
  rays.anchor = torch::zeros({4, 3});
  CHECK_NOTHROW(MarchRays(rays, kNear, kFar, 10, grid.bits));
  CHECK_THROWS_AS(MarchRays(rays, kNear, kFar, 10, grid.bits, &grid.bits), ShapeError);
  CHECK_THROWS_AS(MarchRays(rays, kNear, kFar, 0, grid.bits), ShapeError);
  CHECK_THROWS_AS(MarchRays(RandomRays(0), kNear, kFar, 10, grid.bits), ShapeError);
  rays = RandomRays(5);
  rays.turn = torch::zeros({5, 3});
  CHECK_THROWS_AS(MarchRays(rays, kNear, kFar, 10, grid.bits, &grid.bits), ShapeError);
}
