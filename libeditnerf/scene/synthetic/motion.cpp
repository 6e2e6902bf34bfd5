#include "libeditnerf/scene/synthetic/motion.h"

#include <algorithm>
#include <cmath>

#include "libeditnerf/scene/synthetic/texture.h"

namespace editnerf::synthetic {
namespace {

constexpr uint64_t kCandidates = 96;

// Zero speed and zero acceleration at both ends.
double Ease(double t) { return t * t * t * (10 + t * (6 * t - 15)); }

double NearestDistance(const State& state, const std::vector<State>& others) {
  double nearest = 1e9;
  for (const State& other : others) nearest = std::min(nearest, StateDistance(state, other));
  return nearest;
}

State TrackAt(const Track& track, double time) {
  if (time <= track.front().time) return track.front().state;
  for (size_t k = 1; k < track.size(); ++k) {
    if (time > track[k].time) continue;
    const Keyframe& from = track[k - 1];
    const Keyframe& to = track[k];
    const double blend = Ease((time - from.time) / (to.time - from.time));
    State state = from.state;
    for (size_t i = 0; i < state.size(); ++i) state[i] += blend * (to.state[i] - from.state[i]);
    return state;
  }
  return track.back().state;
}

}  // namespace

State StateAt(const std::vector<Track>& tracks, double time) {
  State state;
  for (const Track& track : tracks) {
    const State part = TrackAt(track, time);
    state.insert(state.end(), part.begin(), part.end());
  }
  return state;
}

std::vector<State> UnseenStates(const std::vector<State>& visited, const std::vector<Track>& tracks, int64_t count,
                                uint64_t seed) {
  const auto pick = [&](uint64_t a, uint64_t b, uint64_t c) -> const State& {
    const auto size = static_cast<double>(visited.size());
    return visited[static_cast<size_t>(HashUnit(seed + 51, a, b, c) * size)];
  };
  std::vector<State> chosen;
  while (static_cast<int64_t>(chosen.size()) < count) {
    State best;
    double best_distance = -1;
    for (uint64_t candidate = 0; candidate < kCandidates; ++candidate) {
      State state = visited.front();
      size_t begin = 0;
      for (size_t p = 0; p < tracks.size(); ++p) {
        const State& a = pick(chosen.size(), candidate, 2 * p);
        const State& b = pick(chosen.size(), candidate, 2 * p + 1);
        const double blend = HashUnit(seed + 52, chosen.size(), candidate, p);
        const size_t end = begin + tracks[p].front().state.size();
        for (; begin < end; ++begin) state[begin] = a[begin] + blend * (b[begin] - a[begin]);
      }
      const double distance = std::min(NearestDistance(state, visited), NearestDistance(state, chosen));
      if (distance > best_distance) {
        best_distance = distance;
        best = state;
      }
    }
    chosen.push_back(best);
  }
  return chosen;
}

std::vector<State> SlidingStates(const std::vector<State>& visited, const std::vector<Track>& tracks, int64_t count) {
  const size_t size = tracks.front().front().state.size();  // of the first part's own parameters
  const auto part = [&](const State& state) { return State(state.begin(), state.begin() + static_cast<long>(size)); };
  const auto between = [&](const State& from, const State& to, double blend) {
    State state = from;
    for (size_t i = 0; i < size; ++i) state[i] += blend * (to[i] - from[i]);
    return state;
  };
  std::vector<State> parts;
  parts.reserve(visited.size());
  for (const State& state : visited) parts.push_back(part(state));
  size_t from = 0, to = 0;
  double farthest = -1;
  for (size_t a = 0; a < parts.size(); ++a) {
    for (size_t b = a + 1; b < parts.size(); ++b) {
      const double distance = NearestDistance(between(parts[a], parts[b], 0.5), parts);
      if (distance > farthest) farthest = distance, from = a, to = b;
    }
  }
  std::vector<State> states;
  for (int64_t k = 1; k <= count; ++k) {
    states.push_back(between(visited[from], visited[to], static_cast<double>(k) / static_cast<double>(count + 1)));
  }
  return states;
}

double StateDistance(const State& a, const State& b) {
  double sum = 0;
  for (size_t i = 0; i < a.size(); ++i) sum += (a[i] - b[i]) * (a[i] - b[i]);
  return std::sqrt(sum);
}

}  // namespace editnerf::synthetic
