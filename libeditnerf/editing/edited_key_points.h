// From what an edit names to the key points of a frame.
#pragma once

#include <torch/types.h>

#include <cstdint>
#include <optional>
#include <vector>

#include "libeditnerf/geometry/vec3.h"

namespace editnerf {

// Positions by key point index, scene units; not given or beyond the end: unchanged.
using NamedKeyPoints = std::vector<std::optional<Vec3>>;

// The key points [N, 3] of a frame with the named ones replaced; type and device are kept. Throws DataError where a
// key point beyond N is named.
torch::Tensor EditedKeyPoints(const NamedKeyPoints& named, const torch::Tensor& key_points);

// The row of tracks [T, N, 3], T >= 1, whose key points are nearest to the named ones (least sum of squared distances,
// the first of equals), and that distance (root of the sum): the default code frame of an edit. Throws DataError where
// none is named, or one beyond N.
struct NearestRow {
  int64_t row = 0;
  double distance = 0;  // scene units
};
NearestRow NearestKeyPoints(const NamedKeyPoints& named, const torch::Tensor& tracks);

}  // namespace editnerf
