#include "libeditnerf/render/occupancy_grid.h"

#include <torch/types.h>
#include <torch/utils.h>

#include <algorithm>
#include <cmath>

#include "libeditnerf/base/error.h"
#include "libeditnerf/base/shape.h"

namespace editnerf {
namespace {

constexpr int64_t kVisited = 8;  // after the warm-up an update visits one cell in so many, and as many occupied ones

// An index at random from each of `count` equal parts of [0, size), or all where there are no more: takes a random
// number for each of these, not for all of the indices. Two neighbours may draw the same one.
torch::Tensor OneOfEachPart(int64_t count, int64_t size, const torch::TensorOptions& options) {
  const torch::Tensor part = torch::arange(std::min(count, size), options.dtype(torch::kFloat64));
  if (size <= count) return part.to(options.dtype());
  const double width = static_cast<double>(size) / static_cast<double>(count);
  return ((part + torch::rand_like(part)) * width).to(options.dtype()).clamp_max(size - 1);
}

// Every cell of the cube [n, n, n] that is set or has a neighbour that is, diagonal ones too: axis by axis, which takes
// a tenth of the time of max_pool3d.
torch::Tensor Dilated(torch::Tensor bits) {
  for (int64_t axis = 0; axis < 3; ++axis) {
    const int64_t most = bits.size(axis) - 1;
    torch::Tensor grown = bits.clone();
    grown.narrow(axis, 0, most).logical_or_(bits.narrow(axis, 1, most));
    grown.narrow(axis, 1, most).logical_or_(bits.narrow(axis, 0, most));
    bits = grown;
  }
  return bits;
}

}  // namespace

Box BoxAroundRays(const torch::Tensor& origin, const torch::Tensor& direction, double near, double far, double margin) {
  CheckShape(origin, {kAny, 3}, "origin");
  CheckShape(direction, {origin.size(0), 3}, "direction");
  torch::NoGradGuard no_grad;
  const auto ends = torch::cat({origin + near * direction, origin + far * direction}).to(torch::kCPU, torch::kFloat64);
  auto low = std::get<0>(ends.min(0)), high = std::get<0>(ends.max(0));
  const auto grow = margin * (high - low);
  low = low - grow;
  high = high + grow;
  const auto l = low.accessor<double, 1>(), h = high.accessor<double, 1>();
  return {{l[0], l[1], l[2]}, {h[0], h[1], h[2]}};
}

OccupancyGrid::OccupancyGrid(const Box& box, const OccupancyOptions& options) : options_(options) {
  const Vec3 size = box.high - box.low;
  if (!(size.x > 0 && size.y > 0 && size.z > 0)) {
    Throw<ConfigError>("occupancy grid: expected a box with a volume, found sides {} x {} x {}", size.x, size.y,
                       size.z);
  }
  if (!(options.step > 0)) Throw<ConfigError>("occupancy grid: step {}: expected a positive length", options.step);
  if (options.resolution < 1) {
    Throw<ConfigError>("occupancy grid: resolution {}: expected at least 1", options.resolution);
  }
  const int64_t cells = options.resolution * options.resolution * options.resolution;
  low_ = register_buffer("low", torch::tensor({box.low.x, box.low.y, box.low.z}, torch::kFloat64));
  high_ = register_buffer("high", torch::tensor({box.high.x, box.high.y, box.high.z}, torch::kFloat64));
  density_ = register_buffer("density", torch::zeros({cells}, torch::kFloat32));
  occupied_ = register_buffer("occupied", torch::ones({cells}, torch::kBool));
  updates_ = register_buffer("updates", torch::zeros({}, torch::kInt64));
}

torch::Tensor OccupancyGrid::Inside(const torch::Tensor& x) const {
  CheckLastDim(x, 3, "x");
  torch::NoGradGuard no_grad;
  return torch::logical_and(x >= low_.to(x.dtype()), x < high_.to(x.dtype())).all(-1);
}

torch::Tensor OccupancyGrid::Occupied(const torch::Tensor& x) const {
  CheckLastDim(x, 3, "x");
  torch::NoGradGuard no_grad;
  const int64_t n = options_.resolution;
  const auto low = low_.to(x.dtype());
  const auto cell = (x.detach() - low) * (static_cast<double>(n) / (high_ - low_)).to(x.dtype());
  // Comparing before the conversion to integers: NaN and huge coordinates are outside, whatever they would convert to.
  const auto inside = torch::logical_and(cell >= 0, cell < n).all(-1);
  const auto index = torch::where(inside.unsqueeze(-1), cell, torch::zeros_like(cell)).to(torch::kInt64);
  const auto flat = (index.select(-1, 0) * n + index.select(-1, 1)) * n + index.select(-1, 2);
  return torch::logical_and(inside, occupied_.index_select(0, flat.flatten()).view(flat.sizes()));
}

torch::Tensor OccupancyGrid::AllCells() const {
  return torch::arange(density_.size(0), torch::TensorOptions(torch::kInt64).device(density_.device()));
}

torch::Tensor OccupancyGrid::VisitedCells() const {
  if (updates_.item<int64_t>() < options_.warm_up) return AllCells();
  const int64_t cells = density_.size(0), count = (cells + kVisited - 1) / kVisited;
  const torch::Tensor occupied = occupied_.nonzero().squeeze(1);
  torch::Tensor visited = torch::zeros_like(occupied_);
  visited.index_fill_(0, OneOfEachPart(count, cells, occupied.options()), true);
  visited.index_fill_(0, occupied.index_select(0, OneOfEachPart(count, occupied.size(0), occupied.options())), true);
  return visited.nonzero().squeeze(1);
}

torch::Tensor OccupancyGrid::PointsIn(const torch::Tensor& cells) const {
  const int64_t n = options_.resolution;
  const auto x = torch::div(cells, n * n, "floor"), y = torch::div(cells, n, "floor").remainder(n);
  const auto corner = torch::stack({x, y, cells.remainder(n)}, 1).to(torch::kFloat64);
  return low_ + (corner + torch::rand(corner.sizes(), density_.options())) / n * (high_ - low_);
}

void OccupancyGrid::Update(const DensityFunction& density) {
  Visit(VisitedCells(), density, options_.decay);
  updates_.add_(1);
}

void OccupancyGrid::Cover(const DensityFunction& density) { Visit(AllCells(), density, 1); }

void OccupancyGrid::Visit(const torch::Tensor& cells, const DensityFunction& density, double decay) {
  torch::NoGradGuard no_grad;
  const auto found = density(PointsIn(cells).to(torch::kFloat32)).detach().to(torch::kFloat32);
  CheckShape(found, {cells.size(0)}, "density");
  const auto remembered = density_.index_select(0, cells) * decay;
  // A NaN counts as dense, so that rays go on meeting it and their losses show it; as empty it would be hidden, and a
  // field of nothing but NaN would train on without complaint.
  density_.index_copy_(0, cells, torch::maximum(remembered, found.nan_to_num(1 / options_.step)));
  UpdateBits();
}

void OccupancyGrid::UpdateBits() {
  const int64_t n = options_.resolution;
  const double opaque_enough = -std::log1p(-std::min(options_.threshold, 1 - 1e-12)) / options_.step;
  const double threshold = std::min(opaque_enough, 0.5 * density_.mean(torch::kFloat64).item<double>());
  auto bits = density_ >= threshold;
  if (options_.dilate) bits = Dilated(bits.view({n, n, n})).view({-1});
  occupied_.copy_(bits);
}

double OccupancyGrid::OccupiedShare() const { return occupied_.to(torch::kFloat64).mean().item<double>(); }

}  // namespace editnerf
