#include "libeditnerf/kernels/ray_cursor.h"

#include "libeditnerf/base/error.h"
#include "libeditnerf/base/shape.h"

namespace editnerf {

MarchedGrid::MarchedGrid(const OccupancyBits& bits) : resolution(bits.resolution) {
  CheckShape(bits.low, {3}, "occupancy low");
  CheckShape(bits.high, {3}, "occupancy high");
  CheckShape(bits.occupied, {resolution * resolution * resolution}, "occupancy bits");
  if (!bits.occupied.is_cpu() || bits.occupied.scalar_type() != at::kBool || !bits.occupied.is_contiguous()) {
    Throw<ShapeError>("marching: occupancy: expected bool on the CPU, found {}", bits.occupied.toString());
  }
  occupied = bits.occupied.data_ptr<bool>();
  const auto box_low = bits.low.accessor<double, 1>(), box_high = bits.high.accessor<double, 1>();
  for (int axis = 0; axis < 3; ++axis) {
    low[axis] = static_cast<float>(box_low[axis]);
    scale[axis] = static_cast<float>(static_cast<double>(resolution) / (box_high[axis] - box_low[axis]));
  }
}

RayInGrid::RayInGrid(const LocalView& view, const float* origin, const float* direction, double first_t, double step)
    : view_(view) {
  double first[3], along[3];
  for (int axis = 0; axis < 3; ++axis) {
    first[axis] = origin[axis] + first_t * direction[axis];
    if (view.anchor != nullptr) first[axis] -= view.anchor[axis];
    along[axis] = step * direction[axis];
  }
  const MarchedGrid& grid = *view.grid;
  for (int own = 0; own < 3; ++own) {
    double x = first[own], advance = along[own];
    if (view.turn != nullptr) {
      const float* const row = view.turn + 3 * own;
      x = row[0] * first[0] + row[1] * first[1] + row[2] * first[2];
      advance = row[0] * along[0] + row[1] * along[1] + row[2] * along[2];
    }
    start_[own] = (x - grid.low[own]) * grid.scale[own];
    per_cell_[own] = 1 / (advance * grid.scale[own]);
  }
}

void RayInGrid::Clip(int64_t* first, int64_t* last) const {
  auto enter = static_cast<double>(*first), leave = static_cast<double>(*last);
  for (int axis = 0; axis < 3; ++axis) {
    const double low = (-kSlack - start_[axis]) * per_cell_[axis];
    const double high = (static_cast<double>(view_.grid->resolution) + kSlack - start_[axis]) * per_cell_[axis];
    enter = std::max(enter, std::min(low, high));
    leave = std::min(leave, std::max(low, high));
  }
  *last = enter <= leave ? std::min(*last, static_cast<int64_t>(leave) + 1) : *first;
  if (enter <= leave) *first = static_cast<int64_t>(enter);
}

int64_t RayInGrid::Next(int64_t i, int64_t last, const float x[3]) const {
  const MarchedGrid& grid = *view_.grid;
  int64_t corner[3];
  float local[3];
  view_.Apply(x, local);
  for (int axis = 0; axis < 3; ++axis) {
    const float cell = (local[axis] - grid.low[axis]) * grid.scale[axis];
    if (!(cell >= 0 && cell < static_cast<float>(grid.resolution))) return i + 1;
    corner[axis] = static_cast<int64_t>(cell);
  }
  if (grid.occupied[(corner[0] * grid.resolution + corner[1]) * grid.resolution + corner[2]]) return i;
  auto exit = static_cast<double>(last);
  for (int axis = 0; axis < 3; ++axis) {
    if (!std::isfinite(per_cell_[axis])) continue;
    const double wall = static_cast<double>(corner[axis]) + (per_cell_[axis] > 0 ? 1 - kSlack : kSlack);
    exit = std::min(exit, (wall - start_[axis]) * per_cell_[axis]);
  }
  return static_cast<int64_t>(std::max(exit, static_cast<double>(i))) + 1;
}

RayCursor::RayCursor(const MarchedGrid& grid, const LocalView& local, const MarchedSteps& steps, const float* origin,
                     const float* direction, float jitter, int64_t first_sample)
    : steps_(&steps), origin_(origin), direction_(direction), jitter_(jitter), next_(first_sample), last_(steps.count) {
  const double first = steps.Position(0, jitter);
  views_[num_views_++] = RayInGrid({&grid, nullptr, nullptr}, origin, direction, first, steps.step);
  if (local.grid != nullptr) views_[num_views_++] = RayInGrid(local, origin, direction, first, steps.step);
  for (int v = 0; v < num_views_; ++v) views_[v].Clip(&next_, &last_);
}

int64_t RayCursor::Next(float* t, float x[3]) {
  while (next_ < last_) {
    *t = steps_->Position(next_, jitter_);
    for (int axis = 0; axis < 3; ++axis) x[axis] = origin_[axis] + *t * direction_[axis];
    int64_t reached = next_;
    for (int v = 0; v < num_views_ && reached == next_; ++v) reached = views_[v].Next(next_, last_, x);
    if (reached == next_) return next_++;
    next_ = reached;
  }
  return -1;
}

}  // namespace editnerf
