// Key points that turn out to be one. Detection keeps one for each part as far as tracks tell; where a number was
// forced (detect.count), or two tracks were too noisy to be taken for one part, two key points may lie on the same
// part. The second then says nothing that the first does not, and the weights have to choose between them.
#pragma once

#include <torch/types.h>

#include <cstdint>
#include <utility>
#include <vector>

#include "libeditnerf/pipeline/stages.h"

namespace editnerf {

// Of every detected key point, the run's that stands for it: 0 .. N - 1 where none is merged, [0, 1, 0] where the third
// of three moves as the first does.
using KeyPointMap = std::vector<int64_t>;

KeyPointMap EachByItself(int64_t num_key_points);

// `map` with key point `goes` of the run merged into `stays`, which comes before it.
KeyPointMap WithMerged(KeyPointMap map, int64_t stays, int64_t goes);

// The pairs (stays, goes) of tracks [T, N, 3] in scene units that move as one rigid part (tracking/track_relation.h).
std::vector<std::pair<int64_t, int64_t>> KeyPointsOfOnePart(const torch::Tensor& tracks, double merge_distance);

// The first of the detected key points that each of the run's stands for, with whatever the others carried. Throws
// ConfigError unless `map` has one entry for each and leaves out no number.
DetectedKeyPoints Merged(const DetectedKeyPoints& detected, const KeyPointMap& map);

}  // namespace editnerf
