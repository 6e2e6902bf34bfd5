#include "libeditnerf/tracking/candidates.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>

#include "libeditnerf/base/error.h"

namespace editnerf {
namespace {

constexpr double kLeastOwnMotion = 0.4;     // pixels a frame at 320 wide
constexpr double kFlowPrecision = 0.3;      // pixels, whatever the image's size
constexpr double kLeastMotionShare = 0.55;  // of the strongest part's
// Of the motion that the camera causes: errors of depth and flow grow with it. Moving parts of the synthetic scenes lie
// above 1.8, places of a static one below 0.62. Not asked of what moves in most frames that see it by the evidence,
// which allows for such errors.
constexpr double kLeastCameraShare = 0.65;
constexpr double kMovesMostly = 0.4;
constexpr double kLeastFramesShare = 0.35;  // of the frames in which the longest moves

size_t At(int64_t i) { return static_cast<size_t>(i); }

// How far a point moves from frame to frame, in pixels, while it moves: the upper quartile of its own motion.
double MotionStrength(const Candidate& candidate) {
  std::vector<double> lengths;
  for (const Pixel& p : candidate.own_motion)
    if (std::isfinite(p.u)) lengths.push_back(std::hypot(p.u, p.v));
  return UpperQuartile(std::move(lengths));
}

// Whether two tracks move together in the image: on one part, whatever the depth maps say of it. Tracks that are not
// seen together (an upper and an under side) are taken for one part where they pass each other nearer than they move.
bool MoveTogether(const Candidate& a, const Candidate& b) {
  constexpr int kLeastFrames = 5;
  constexpr double kLeastCorrelation = 0.6;
  double aa = 0, bb = 0, ab = 0, nearest = std::numeric_limits<double>::infinity();
  int frames = 0;
  for (size_t t = 0; t < a.own_motion.size(); ++t) {
    nearest = std::min(nearest, Norm(a.refined.position[t] - b.refined.position[t]));
    const Pixel &p = a.own_motion[t], &q = b.own_motion[t];
    if (!std::isfinite(p.u) || !std::isfinite(q.u)) continue;
    aa += p.u * p.u + p.v * p.v, bb += q.u * q.u + q.v * q.v, ab += p.u * q.u + p.v * q.v;
    ++frames;
  }
  if (frames < kLeastFrames) return nearest < std::min(a.motion.range, b.motion.range);
  return ab > kLeastCorrelation * std::sqrt(aa * bb);
}

}  // namespace

std::string Place(const Vec3& p) { return fmt::format("({:.3f}, {:.3f}, {:.3f})", p.x, p.y, p.z); }

double UpperQuartile(std::vector<double> values) {
  if (values.empty()) return 0;
  const auto quartile = values.begin() + static_cast<int64_t>(values.size() * 3 / 4);
  std::nth_element(values.begin(), quartile, values.end());
  return *quartile;
}

void RejectWeakMotion(std::vector<Candidate>* candidates, double pixel_scale) {
  // The strongest of those that move for long: a track of a few frames may be a few wrong depths.
  double strongest = 0;
  int64_t longest = 0;
  for (const Candidate& candidate : *candidates)
    if (candidate.objection.empty()) longest = std::max(longest, candidate.moving);
  for (const Candidate& candidate : *candidates)
    if (candidate.objection.empty() && 2 * candidate.moving >= longest)
      strongest = std::max(strongest, MotionStrength(candidate));
  const double least = std::max({kLeastOwnMotion * pixel_scale, kFlowPrecision, kLeastMotionShare * strongest});
  for (Candidate& candidate : *candidates) {
    if (!candidate.objection.empty()) continue;
    const double strength = MotionStrength(candidate);
    if (static_cast<double>(candidate.moving) < kLeastFramesShare * static_cast<double>(longest)) {
      candidate.objection =
          fmt::format("it moves in {} frames only, where another does in {}", candidate.moving, longest);
    } else if (strength < least) {
      candidate.objection =
          fmt::format("it moves by {:.2f} pixels a frame, less than {:.2f} (the strongest moves by {:.2f})", strength,
                      least, strongest);
    } else if (strength < kLeastCameraShare * candidate.camera_strength &&
               static_cast<double>(candidate.moving) <
                   kMovesMostly * static_cast<double>(candidate.pixels.CountVisible())) {
      candidate.objection = fmt::format("it moves by {:.2f} pixels a frame where the camera moves it by {:.2f}",
                                        strength, candidate.camera_strength);
    }
  }
}

void RejectShadows(std::vector<Candidate>* candidates) {
  const bool any_surface = std::any_of(candidates->begin(), candidates->end(), [](const Candidate& candidate) {
    return candidate.objection.empty() && !candidate.on_static_surface;
  });
  for (Candidate& candidate : *candidates) {
    if (!any_surface || !candidate.objection.empty() || !candidate.on_static_surface) continue;
    candidate.objection = "what moves there lies on the static scene, as a shadow does";
  }
}

void MergeDuplicates(std::vector<Candidate>* candidates, double merge_distance) {
  std::vector<Candidate*> order;
  for (Candidate& candidate : *candidates) order.push_back(&candidate);
  const auto known = [](const Candidate* candidate) {
    return std::count(candidate->track.visible.begin(), candidate->track.visible.end(), true);
  };
  std::stable_sort(order.begin(), order.end(),
                   [&](const Candidate* a, const Candidate* b) { return known(a) > known(b); });
  for (size_t i = 0; i < order.size(); ++i) {
    Candidate& shorter = *order[i];
    for (size_t j = 0; j < i && shorter.objection.empty(); ++j) {
      const Candidate& longer = *order[j];
      if (!longer.objection.empty()) continue;
      if (!MoveTogether(longer, shorter) && !SameRigidPart(longer.refined, shorter.refined, merge_distance)) continue;
      shorter.objection = fmt::format("it moves as one part with the one at {}, which is known in more frames",
                                      Place(longer.maximum.point));
    }
  }
}

std::vector<const Candidate*> SelectCandidates(const std::vector<Candidate>& candidates, const DetectionConfig& config,
                                               std::vector<std::string>* notes) {
  std::vector<const Candidate*> kept;
  const auto wanted = At(config.count > 0 ? config.count : config.max_count);
  for (const Candidate& candidate : candidates) {
    if (!candidate.objection.empty()) continue;
    if (kept.size() < wanted) {
      kept.push_back(&candidate);
    } else {
      notes->push_back(fmt::format("candidate at {} dropped: {} stronger key points are kept",
                                   Place(candidate.maximum.point), wanted));
    }
  }
  for (const Candidate& candidate : candidates) {
    if (candidate.objection.empty()) continue;
    const bool forced = config.count > 0 && kept.size() < wanted;
    if (forced) kept.push_back(&candidate);
    notes->push_back(fmt::format("candidate at {} {}: {}", Place(candidate.maximum.point),
                                 forced ? "kept because the number of key points is given" : "dropped",
                                 candidate.objection));
  }
  if (config.count > 0 && kept.size() < wanted) {
    Throw<ConfigError>(
        "detection: detect.count asks for {} key points, but only {} places of the scene qualify; lower it, or "
        "lower detect.relative_threshold and detect.min_distance",
        config.count, kept.size());
  }
  return kept;
}

}  // namespace editnerf
