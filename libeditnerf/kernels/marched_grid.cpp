#include "libeditnerf/kernels/marched_grid.h"

#include "libeditnerf/base/error.h"
#include "libeditnerf/base/shape.h"

namespace editnerf {
namespace {

constexpr bool kEmpty[4] = {}, kFull[4] = {true, true, true, true};  // grids of one cell

}  // namespace

MarchedGrid::MarchedGrid(const OccupancyBits& bits) : resolution(bits.resolution) {
  CheckShape(bits.low, {3}, "occupancy low");
  CheckShape(bits.high, {3}, "occupancy high");
  CheckShape(bits.occupied, {resolution * resolution * resolution}, "occupancy bits");
  if (!bits.occupied.is_cpu() || bits.occupied.scalar_type() != at::kBool || !bits.occupied.is_contiguous()) {
    Throw<ShapeError>("marching: occupancy: expected bool on the CPU, found {}", bits.occupied.toString());
  }
  occupied = bits.occupied.data_ptr<bool>();
  if (resolution == 1) occupied = *occupied ? kFull : kEmpty;
  const auto box_low = bits.low.accessor<double, 1>(), box_high = bits.high.accessor<double, 1>();
  for (int axis = 0; axis < 3; ++axis) {
    low[axis] = static_cast<float>(box_low[axis]);
    scale[axis] = static_cast<float>(static_cast<double>(resolution) / (box_high[axis] - box_low[axis]));
  }
}

}  // namespace editnerf
