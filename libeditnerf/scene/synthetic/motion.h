// How the parts of a synthetic scene move: a handful of parameters over time, and states that the time never visits.
#pragma once

#include <cstdint>
#include <vector>

namespace editnerf::synthetic {

using State = std::vector<double>;  // parameters of all parts; comparable in size (world units, or radians)

struct Keyframe {
  double time = 0;  // ascending
  State state;
};

// One part's parameters over time; at least one key frame. Parts move independently of each other.
using Track = std::vector<Keyframe>;

// All tracks' parameters, one after the other. A track eases out of every key frame and into the next one, rests
// between two equal ones, and stands still before the first and after the last.
State StateAt(const std::vector<Track>& tracks, double time);

// `count` states that none of `visited` (which follow the tracks) is close to: each part lies on a line between two
// states that it visited, parts are combined freely, and of many candidates the one farthest from all visited and
// chosen states wins.
std::vector<State> UnseenStates(const std::vector<State>& visited, const std::vector<Track>& tracks, int64_t count,
                                uint64_t seed);

// `count` states at equal steps of the first track's part on a straight line that it never went: between those two of
// its visited states whose middle is farthest from all it visited. Everything else stays as it is in the first of the
// two.
std::vector<State> SlidingStates(const std::vector<State>& visited, const std::vector<Track>& tracks, int64_t count);

// Euclidean.
double StateDistance(const State& a, const State& b);

}  // namespace editnerf::synthetic
