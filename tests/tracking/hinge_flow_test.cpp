// A part that knows how a sphere swings but for some frames, which only optical flow tells.
#include "libeditnerf/tracking/hinge_flow.h"

#include <torch/types.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <vector>

#include "tests/catch.h"
#include "tests/tracking/swinging_part.h"

using namespace editnerf;

namespace {

size_t At(int64_t t) { return static_cast<size_t>(t); }

// The true flow from frame t to s.
torch::Tensor TrueFlow(const SwingingPart& swinging, int64_t t, int64_t s) {
  const Clip& clip = swinging.clip;
  torch::Tensor flow = torch::full({clip.height, clip.width, 2}, NAN);
  auto to = flow.accessor<float, 3>();
  const torch::Tensor depth = clip.depth[At(t)].contiguous();
  const auto distance = depth.accessor<float, 2>();
  for (int64_t y = 0; y < clip.height; ++y) {
    for (int64_t x = 0; x < clip.width; ++x) {
      const Pixel p = {static_cast<double>(x) + 0.5, static_cast<double>(y) + 0.5};
      Vec3 point = clip.Lift(t, p, static_cast<double>(distance[y][x]));
      const Vec3 from = point - swinging.sphere.center(t);
      if (Norm(from) < 1.05 * SwingingPart::kRadius) {
        const Mat3 turn = RotationAround({0, 0, 1}, SwingingPart::Angle(s) - SwingingPart::Angle(t));
        point = swinging.sphere.center(s) + turn * from;
      }
      const Projected at = Project(clip.cameras[At(s)], point);
      if (!at.valid) continue;
      to[y][x][0] = static_cast<float>(at.u - p.u);
      to[y][x][1] = static_cast<float>(at.v - p.v);
    }
  }
  return flow;
}

struct FlowingPart : SwingingPart {
  FlowingPart() {
    const torch::Tensor everywhere = torch::ones({clip.height, clip.width}, torch::kBool);
    for (int64_t t = 0; t + 1 < kFrames; ++t) {
      clip.forward.push_back(TrueFlow(*this, t, t + 1));
      clip.backward.push_back(TrueFlow(*this, t + 1, t));
      clip.forward_valid.push_back(everywhere);
      clip.backward_valid.push_back(everywhere);
    }
  }

  // The part with frames that do not see it, posed as in the first frame.
  RigidPart Without(int64_t first, int64_t last) const {
    RigidPart lost = part;
    for (int64_t t = first; t <= last; ++t) lost.seen[At(t)] = false, lost.pose[At(t)] = {};
    return lost;
  }

  double WorstAngle(const RigidPart& found) const {
    double worst = 0;
    for (int64_t t = 0; t < kFrames; ++t)
      worst = std::max(worst, Norm(ToVec3(found.pose[At(t)].rotation) - ToVec3(part.pose[At(t)].rotation)));
    return worst;
  }
};

}  // namespace

TEST_CASE("what is on a hinge is followed by flow before it is seen, behind and in between", "[hinge]") {
  const FlowingPart truth;
  struct Gap {
    int64_t first, last;
  };
  for (const Gap& gap : {Gap{16, FlowingPart::kFrames - 1}, Gap{0, 24}, Gap{14, 27}}) {
    CAPTURE(gap.first);
    RigidPart part = truth.Without(gap.first, gap.last);
    CHECK(truth.WorstAngle(part) > 0.5);
    CHECK(static_cast<int64_t>(FollowFlowOnHinge(truth.clip, &part).size()) == gap.last - gap.first + 1);
    CHECK(truth.WorstAngle(part) < 0.04);  // of 0.9
    CHECK_FALSE(part.seen[At(gap.first)]);
  }
}

TEST_CASE("half of the flow may be wrong where a part is followed on its hinge", "[hinge]") {
  FlowingPart truth;
  for (torch::Tensor& flow : truth.clip.forward) {
    const torch::Tensor wrong = torch::arange(flow.size(0)).remainder(2).eq(0).view({-1, 1, 1});
    flow = torch::where(wrong, 7 * torch::sin(torch::arange(flow.numel()).view(flow.sizes()).to(flow.dtype())), flow);
  }
  RigidPart part = truth.Without(16, FlowingPart::kFrames - 1);
  FollowFlowOnHinge(truth.clip, &part);
  CHECK(truth.WorstAngle(part) < 0.08);
}

TEST_CASE("where flow is that of what covers a part, it stays between what is known", "[hinge]") {
  FlowingPart truth;
  for (int64_t t = 14; t < 28; ++t) {
    for (torch::Tensor* flow : {&truth.clip.forward[At(t)], &truth.clip.backward[At(t)]}) flow->fill_(0);
  }
  RigidPart part = truth.Without(15, 27);
  const std::vector<RigidPose> before = part.pose;
  CHECK(FollowFlowOnHinge(truth.clip, &part).empty());
  for (size_t t = 0; t < before.size(); ++t) CHECK(part.pose[t].rotation == before[t].rotation);
}

TEST_CASE("a part that has no hinge is followed nowhere", "[hinge]") {
  const FlowingPart truth;
  RigidPart part = truth.Without(16, FlowingPart::kFrames - 1);
  for (RigidPose& pose : part.pose) pose = {};  // never turned
  CHECK(FollowFlowOnHinge(truth.clip, &part).empty());
  part.seen.assign(part.seen.size(), false);
  CHECK(FollowFlowOnHinge(truth.clip, &part).empty());
}
