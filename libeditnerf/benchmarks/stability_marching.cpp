// Degenerate rays through an occupancy grid: which samples are kept, and where they lie.
#include <torch/types.h>
#include <torch/utils.h>

#include <cmath>
#include <limits>

#include "libeditnerf/base/error.h"
#include "libeditnerf/benchmarks/stability_measure.h"
#include "libeditnerf/config/config.h"
#include "libeditnerf/kernels/ray_march.h"
#include "libeditnerf/render/occupancy_grid.h"
#include "libeditnerf/render/ray_marcher.h"
#include "libeditnerf/render/ray_renderer.h"

namespace editnerf {
namespace {

constexpr int64_t kRays = 60, kSteps = 200, kResolution = 16;
constexpr double kNear = 0.125, kFar = 4.125;
const Box kBox = {{-1, -1, -1}, {1, 1, 1}};

struct Rays {
  std::string name;
  torch::Tensor origin, direction;  // [R, 3] float32
};

// A grid of which a third is occupied, drawn at random.
struct Grid {
  Grid() : grid(kBox, Options()) {
    const auto buffers = grid.named_buffers(/*recurse=*/false);
    bits = {buffers["low"], buffers["high"], buffers["occupied"], kResolution};
    bits.occupied.copy_(torch::rand(bits.occupied.sizes()) < 0.33);
  }
  static OccupancyOptions Options() {
    OccupancyOptions options;
    options.resolution = kResolution;
    return options;
  }

  OccupancyGrid grid;
  OccupancyBits bits;
};

// Origins on walls between cells: multiples of a cell's side, exact in float32.
torch::Tensor OnWalls() {
  return (torch::rand({kRays, 3}) * kResolution).floor() * (2.0 / static_cast<double>(kResolution)) - 1;
}

std::vector<Rays> AllRays(const Grid& grid) {
  const auto axis = torch::randint(3, {kRays}, torch::kInt64);
  const auto sign = (torch::rand({kRays, 1}) < 0.5).to(torch::kFloat32) * 2 - 1;
  const auto along_axis = torch::one_hot(axis, 3).to(torch::kFloat32) * sign;
  const auto within = torch::rand({kRays, 3}) * 2 - 1;
  auto skew = torch::randn({kRays, 3});
  skew = skew / skew.norm(2, 1, true);
  const auto cells = grid.bits.occupied.nonzero().squeeze(1).slice(0, 0, kRays);
  const auto cell =
      torch::stack({torch::div(cells, kResolution * kResolution, "floor"),
                    torch::div(cells, kResolution, "floor").remainder(kResolution), cells.remainder(kResolution)},
                   1);
  const auto in_cells = (cell.to(torch::kFloat32) + 0.5) * (2.0 / static_cast<double>(kResolution)) - 1;
  auto broken_origin = within.clone(), broken_direction = skew.clone();
  broken_origin[3][1] = broken_direction[7][2] = std::numeric_limits<float>::quiet_NaN();
  broken_origin[11][0] = broken_direction[13][1] = std::numeric_limits<float>::infinity();
  return {{"along an axis", within - 1.5 * along_axis, along_axis},
          {"along an axis, in a wall of cells", OnWalls(), along_axis},
          {"in the faces of the box", torch::where(along_axis == 0, torch::sign(within), within), along_axis},
          {"direction zero", torch::cat({within.slice(0, 0, kRays / 2), 2 * within.slice(0, kRays / 2)}),
           torch::zeros_like(within)},
          {"direction 1e-30", within, 1e-30 * skew},
          {"direction 1e30", within, 1e30 * skew},
          {"from within an occupied cell", in_cells, skew},
          {"away from the box", 3 * torch::sign(within), torch::sign(within)},
          {"NaN and infinite", broken_origin, broken_direction}};
}

// Every candidate by itself, in extended precision. `open`: whether rounding may decide either way, as the sample lies
// beside a wall but not on it.
struct Kept {
  torch::Tensor t, keep, open;  // [R, kSteps]
};

Kept Expected(const Rays& rays, const torch::Tensor& jitter, const Grid& grid) {
  Kept expected = {torch::empty({kRays, kSteps}, torch::kFloat64), torch::zeros({kRays, kSteps}, torch::kBool),
                   torch::zeros({kRays, kSteps}, torch::kBool)};
  const auto* const occupied = grid.bits.occupied.data_ptr<bool>();
  for (int64_t r = 0; r < kRays; ++r) {
    for (int64_t i = 0; i < kSteps; ++i) {
      const Real t =
          kNear + (i + static_cast<Real>(jitter.data_ptr<float>()[r])) * (static_cast<Real>(kFar) - kNear) / kSteps;
      expected.t.data_ptr<double>()[r * kSteps + i] = static_cast<double>(t);
      bool inside = true, open = false;
      int64_t index = 0;
      for (int64_t axis = 0; axis < 3; ++axis) {
        const Real step = rays.direction.data_ptr<float>()[3 * r + axis];
        const Real x = rays.origin.data_ptr<float>()[3 * r + axis] + t * step;
        const Real cell = (x + 1) * kResolution / 2;
        open = open || (step != 0 && std::abs(cell - std::round(cell)) < 1e-4);
        inside = inside && cell >= 0 && cell < kResolution;
        if (inside) index = index * kResolution + static_cast<int64_t>(cell);
      }
      expected.keep.data_ptr<bool>()[r * kSteps + i] = inside && occupied[index];
      expected.open.data_ptr<bool>()[r * kSteps + i] = open;
    }
  }
  // The first sample stands in where there is none at all.
  if (!expected.keep.any().item<bool>()) expected.keep[0][0] = true;
  return expected;
}

PackedSamples ByKernel(const Rays& rays, const torch::Tensor& jitter, const Grid& grid) {
  return MarchRays({rays.origin, rays.direction, jitter, {}, {}}, kNear, kFar, kSteps, grid.bits);
}

PackedSamples ByLibTorch(const Rays& rays, const torch::Tensor& jitter, const Grid& grid) {
  const auto t = MarchCandidates(torch::full({kRays}, kNear), torch::full({kRays}, kFar), kSteps, jitter);
  const auto x = rays.origin.unsqueeze(1) + t.unsqueeze(2) * rays.direction.unsqueeze(1);
  return PackSamples(t, torch::full_like(t, (kFar - kNear) / kSteps), grid.grid.Occupied(x));
}

StabilityRow RowOf(const Rays& rays, const std::string& variant, const PackedSamples& found, const Kept& expected,
                   const torch::Tensor& jitter) {
  const double step = (kFar - kNear) / kSteps;
  const auto number =
      ((found.t.to(torch::kFloat64) - kNear) / step - jitter.index_select(0, found.ray)).round().to(torch::kInt64);
  auto kept = torch::zeros_like(expected.keep);
  kept.index_put_({found.ray, number}, true);
  const auto wrong = kept.ne(expected.keep).logical_and(expected.open.logical_not());
  const auto exact = expected.t.index({found.ray, number});
  // One sample that is wrongly kept or left out fails.
  const double error = LargestRelativeError(found.t, exact, kFar) + wrong.sum().item<double>();
  return {"marching",   rays.name,
          variant,      {error, 4 * SinglePrecision().rounding},
          std::nullopt, AllFinite({found.t, found.delta})};
}

// Refused where a renderer is made, by an error that names both.
StabilityRow EmptyRangeRow() {
  const double nan = std::numeric_limits<double>::quiet_NaN();
  double accepted = 0;
  for (const auto& [near, far] : {std::pair(1.0, 1.0), std::pair(2.0, 1.0), std::pair(nan, 1.0), std::pair(0.0, nan)}) {
    try {
      const RayRenderer renderer(RenderConfig(), near, far, kBox, std::nullopt);
      ++accepted;
    } catch (const ConfigError&) {  // as it should be
    }
  }
  return {"marching", "near = far, near > far, NaN", "refused", {accepted, 0}, std::nullopt, true};
}

}  // namespace

StabilityRows MarchingStability() {
  torch::manual_seed(8);
  StabilityRows rows;
  const Grid grid;
  for (Rays& rays : AllRays(grid)) {
    rays.origin = rays.origin.contiguous(), rays.direction = rays.direction.contiguous();
    const auto jitter = torch::rand({kRays});
    const auto expected = Expected(rays, jitter, grid);
    rows.push_back(RowOf(rays, "LibTorch float32", ByLibTorch(rays, jitter, grid), expected, jitter));
    rows.push_back(RowOf(rays, "kernel", ByKernel(rays, jitter, grid), expected, jitter));
  }
  rows.push_back(EmptyRangeRow());
  return rows;
}

}  // namespace editnerf
