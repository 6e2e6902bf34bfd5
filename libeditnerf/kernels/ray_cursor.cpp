#include "libeditnerf/kernels/ray_cursor.h"

#include <algorithm>

namespace editnerf {
namespace {

// Cells by which a box is grown before a ray is cut to it: far more than rounding.
constexpr double kSlack = 1e-3;

// Narrows the samples [first, last) to those that may lie in the view's box. A NaN narrows nothing.
void Clip(const GridView& view, const RayInGrids& ray, const MarchedSteps& steps, int64_t* first, int64_t* last) {
  const double first_t = steps.Position(0, ray.jitter), step = steps.step;
  double start[3], along[3];
  for (int axis = 0; axis < 3; ++axis) {
    start[axis] = ray.origin[axis] + first_t * ray.direction[axis];
    if (view.anchor != nullptr) start[axis] -= view.anchor[axis];
    along[axis] = step * ray.direction[axis];
  }
  const MarchedGrid& grid = *view.grid;
  auto enter = static_cast<double>(*first), leave = static_cast<double>(*last);
  for (int own = 0; own < 3; ++own) {
    double x = start[own], advance = along[own];
    if (view.turn != nullptr) {
      const float* const row = view.turn + 3 * own;
      x = row[0] * start[0] + row[1] * start[1] + row[2] * start[2];
      advance = row[0] * along[0] + row[1] * along[1] + row[2] * along[2];
    }
    const double cell = (x - grid.low[own]) * grid.scale[own], samples_per_cell = 1 / (advance * grid.scale[own]);
    const double low = (-kSlack - cell) * samples_per_cell;
    const double high = (static_cast<double>(grid.resolution) + kSlack - cell) * samples_per_cell;
    enter = std::max(enter, std::min(low, high));
    leave = std::min(leave, std::max(low, high));
  }
  *last = enter <= leave ? std::min(*last, static_cast<int64_t>(leave) + 1) : *first;
  if (enter <= leave) *first = static_cast<int64_t>(enter);
}

int LowestBit(uint32_t bits) { return __builtin_ctz(bits); }

}  // namespace

RayCursor::RayCursor(const MarchedGrid& grid, const GridView& local, const MarchedSteps& steps, const float* origin,
                     const float* direction, float jitter, int64_t first_sample)
    : steps_(&steps), next_(first_sample), last_(steps.count) {
  ray_.origin = origin, ray_.direction = direction, ray_.jitter = jitter;
  ray_.views[ray_.num_views++].grid = &grid;
  if (local.grid != nullptr) ray_.views[ray_.num_views++] = local;
  for (int v = 0; v < ray_.num_views; ++v) Clip(ray_.views[v], ray_, steps, &next_, &last_);
}

int64_t RayCursor::Next(float* t, float x[3]) {
  for (; found_ == 0 && next_ < last_; next_ += kLookedUp) {
    first_ = next_;
    found_ = OccupiedSamples(ray_, *steps_, first_);
    if (last_ - first_ < kLookedUp) found_ &= (uint32_t{1} << (last_ - first_)) - 1;
  }
  if (found_ == 0) return -1;
  const int64_t i = first_ + LowestBit(found_);
  found_ &= found_ - 1;
  *t = steps_->Position(i, ray_.jitter);
  for (int axis = 0; axis < 3; ++axis) x[axis] = ray_.origin[axis] + *t * ray_.direction[axis];
  return i;
}

}  // namespace editnerf
