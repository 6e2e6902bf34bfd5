#include "libeditnerf/pipeline/key_point_merging.h"

#include <torch/types.h>

#include <algorithm>
#include <numeric>

#include "libeditnerf/base/error.h"
#include "libeditnerf/tracking/track_relation.h"

namespace editnerf {
namespace {

// Known everywhere: propagation leaves no gaps.
PointTrack TrackOf(const torch::Tensor& tracks, int64_t key_point) {
  PointTrack track;
  const auto at = tracks.accessor<double, 3>();
  for (int64_t t = 0; t < tracks.size(0); ++t) {
    track.position.push_back({at[t][key_point][0], at[t][key_point][1], at[t][key_point][2]});
  }
  track.visible.assign(track.position.size(), true);
  return track;
}

DepthTargets Renumbered(DepthTargets targets, const KeyPointMap& map) {
  if (targets.size() == 0) return targets;
  targets.key_point = targets.key_point.clone();
  int64_t* const key_point = targets.key_point.data_ptr<int64_t>();
  for (int64_t i = 0; i < targets.size(); ++i) {
    if (key_point[i] >= 0) key_point[i] = map[static_cast<size_t>(key_point[i])];
  }
  return targets;
}

}  // namespace

KeyPointMap EachByItself(int64_t num_key_points) {
  KeyPointMap map(static_cast<size_t>(num_key_points));
  std::iota(map.begin(), map.end(), 0);
  return map;
}

KeyPointMap WithMerged(KeyPointMap map, int64_t stays, int64_t goes) {
  for (int64_t& number : map) {
    if (number == goes) {
      number = stays;
    } else if (number > goes) {
      --number;
    }
  }
  return map;
}

std::vector<std::pair<int64_t, int64_t>> KeyPointsOfOnePart(const torch::Tensor& tracks, double merge_distance) {
  const torch::Tensor exact = tracks.to(torch::kCPU, torch::kFloat64);
  std::vector<PointTrack> each;
  for (int64_t n = 0; n < exact.size(1); ++n) each.push_back(TrackOf(exact, n));
  std::vector<std::pair<int64_t, int64_t>> pairs;
  for (size_t i = 0; i < each.size(); ++i) {
    for (size_t j = i + 1; j < each.size(); ++j) {
      if (SameRigidPart(each[i], each[j], merge_distance)) {
        pairs.emplace_back(static_cast<int64_t>(i), static_cast<int64_t>(j));
      }
    }
  }
  return pairs;
}

DetectedKeyPoints Merged(const DetectedKeyPoints& detected, const KeyPointMap& map) {
  const int64_t count = detected.tracks.size(1);
  const int64_t left = map.empty() ? 0 : *std::max_element(map.begin(), map.end()) + 1;
  std::vector<int64_t> first;
  for (int64_t number = 0; number < left; ++number) {
    first.push_back(std::find(map.begin(), map.end(), number) - map.begin());
  }
  const bool complete = std::all_of(first.begin(), first.end(), [&](int64_t n) { return n < count; }) &&
                        std::all_of(map.begin(), map.end(), [](int64_t number) { return number >= 0; });
  if (static_cast<int64_t>(map.size()) != count || !complete) {
    Throw<ConfigError>("merged key points: expected a number from 0 on, none left out, for each of {}, found {}", count,
                       map.size());
  }
  if (left == count) return detected;
  DetectedKeyPoints merged = detected;
  const torch::Tensor rows = torch::tensor(first, torch::kInt64);
  merged.tracks = detected.tracks.index_select(1, rows);
  if (detected.turns.defined()) merged.turns = detected.turns.index_select(1, rows);
  merged.still_depth = Renumbered(detected.still_depth, map);
  merged.part_depth = Renumbered(detected.part_depth, map);
  return merged;
}

}  // namespace editnerf
