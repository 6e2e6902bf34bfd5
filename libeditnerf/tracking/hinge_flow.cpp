#include "libeditnerf/tracking/hinge_flow.h"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <optional>
#include <vector>

#include "libeditnerf/base/logging.h"
#include "libeditnerf/tracking/part_hinge.h"

namespace editnerf {
namespace {

constexpr double kMostTurn = 0.35, kStep = 0.0125;  // radians a frame
constexpr double kNear = 0.7;                       // pixels at 320 wide, at which flow counts by half
constexpr double kLeastMore = 0.03;                 // share of the points by which a turn must be told better than rest
constexpr double kMeet = 0.15;                      // radians between two ways
constexpr size_t kMostPoints = 200;

size_t At(int64_t t) { return static_cast<size_t>(t); }

class HingeFlow {
 public:
  HingeFlow(const Clip& clip, RigidPart* part)
      : clip_(clip), part_(part), seen_(SeenFrames(*part)), hinge_(NearestHinge(*part, seen_)) {
    const size_t stride = std::max<size_t>(1, part->points.size() / kMostPoints);
    for (size_t i = 0; i < part->points.size(); i += stride) points_.push_back(ToVec3(part->points[i].position));
  }

  std::vector<int64_t> Run() {
    if (!hinge_) return {};
    std::vector<int64_t> followed;
    Follow(seen_.front(), -1, -1, &followed);
    Follow(seen_.back(), 1, clip_.num_frames(), &followed);
    for (size_t i = 0; i + 1 < seen_.size(); ++i)
      if (seen_[i + 1] > seen_[i] + 1) Bridge(seen_[i], seen_[i + 1], &followed);
    SetPoses(*hinge_, followed, part_);
    return followed;
  }

 private:
  // Angles of the frames behind `from`, in the order of `step`, and before `end`.
  std::vector<double> Way(int64_t from, int64_t step, int64_t end) const {
    std::vector<double> way;
    double angle = hinge_->angle[At(from)];
    for (int64_t t = from; t + step != end; t += step) way.push_back(angle = Next(t, step, angle));
    return way;
  }

  void Follow(int64_t from, int64_t step, int64_t end, std::vector<int64_t>* followed) {
    for (const double angle : Way(from, step, end)) {
      from += step;
      hinge_->angle[At(from)] = angle;
      followed->push_back(from);
    }
  }

  // The frames between two that see the part: from one side, and from the frame where the two ways are nearest to each
  // other from the other side.
  void Bridge(int64_t first, int64_t last, std::vector<int64_t>* followed) {
    const std::vector<double> on = Way(first, 1, last);
    std::vector<double> back = Way(last, -1, first);
    std::reverse(back.begin(), back.end());
    const auto apart = [&](size_t i) { return std::abs(on[i] - back[i]); };
    size_t meet = 0;
    for (size_t i = 1; i < on.size(); ++i)
      if (apart(i) < apart(meet)) meet = i;
    if (apart(meet) > kMeet) return;
    for (size_t i = 0; i < on.size(); ++i) {
      const int64_t t = first + 1 + static_cast<int64_t>(i);
      hinge_->angle[At(t)] = i < meet ? on[i] : back[i];
      followed->push_back(t);
    }
  }

  std::vector<Projected> Projections(int64_t t, double angle) const {
    std::vector<Projected> projections;
    for (const Vec3& point : points_)
      projections.push_back(Project(clip_.cameras[At(t)], PlaceAt(*hinge_, angle, point)));
    return projections;
  }

  // The angle in frame t + step.
  double Next(int64_t t, int64_t step, double angle) const {
    std::vector<std::optional<Pixel>> carried;
    for (const Projected& at : Projections(t, angle)) {
      const FlowSample flow = at.valid ? clip_.Step(t, step, {at.u, at.v}) : FlowSample();
      carried.push_back(flow.valid ? std::optional<Pixel>({at.u + flow.du, at.v + flow.dv}) : std::nullopt);
    }
    const auto share = [&](double turn) {
      const std::vector<Projected> there = Projections(t + step, angle + turn);
      double sum = 0, count = 0;
      for (size_t i = 0; i < there.size(); ++i) {
        if (!carried[i] || !there[i].valid) continue;
        const double off = Distance(*carried[i], {there[i].u, there[i].v}) / (kNear * clip_.PixelScale());
        sum += 1 / (1 + off * off), count += 1;
      }
      return count > 0 ? sum / count : 0;
    };
    double best = 0, most = share(0) + kLeastMore;
    for (int i = 1; i * kStep <= kMostTurn; ++i) {
      for (const double turn : {i * kStep, -i * kStep})
        if (const double now = share(turn); now > most) most = now, best = turn;
    }
    if (best == 0) return angle;
    // Steps of that width would add up; between them it is where a parabola has its top.
    const double less = share(best - kStep), more = share(best + kStep), bend = less + more - 2 * most;
    if (bend < 0) best += std::clamp(0.5 * (less - more) / bend, -0.5, 0.5) * kStep;
    return angle + best;
  }

  const Clip& clip_;
  RigidPart* part_;
  std::vector<int64_t> seen_;
  std::optional<Hinge> hinge_;
  std::vector<Vec3> points_;
};

}  // namespace

std::vector<int64_t> FollowFlowOnHinge(const Clip& clip, RigidPart* part) {
  if (SeenFrames(*part).empty()) return {};
  std::vector<int64_t> followed = HingeFlow(clip, part).Run();
  LogDebug("moving parts: on its hinge followed by flow in {} frames that do not see it", followed.size());
  return followed;
}

}  // namespace editnerf
