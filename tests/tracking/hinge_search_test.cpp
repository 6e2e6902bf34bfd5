// A part that knows how a sphere swings but for some frames, which its looks tell.
#include "libeditnerf/tracking/hinge_search.h"

#include <torch/types.h>

#include <cmath>

#include "tests/catch.h"
#include "tests/tracking/swinging_part.h"

using namespace editnerf;

TEST_CASE("a part on a hinge is found by its looks in frames that had it elsewhere", "[hinge]") {
  const SwingingPart truth;
  RigidPart part = truth.part;
  for (const size_t t : {3, 4, 20}) part.pose[t] = part.pose[t == 20 ? 0 : 35];
  CHECK(FindLostAngles(truth.clip, truth.tracks, &part) == 3);
  for (size_t t = 0; t < part.pose.size(); ++t) {
    INFO("frame " << t);
    CHECK(part.seen[t]);
    const bool was_right = t != 3 && t != 4 && t != 20;
    CHECK(Norm(ToVec3(part.pose[t].rotation) - ToVec3(truth.part.pose[t].rotation)) <= (was_right ? 0 : 0.03));
    CHECK(Norm(ToVec3(part.pose[t].translation) - ToVec3(truth.part.pose[t].translation)) <= (was_right ? 0 : 0.01));
  }
}

TEST_CASE("a part keeps its way with another reference frame, also where its own was the wrong one", "[hinge]") {
  const SwingingPart truth;
  const RigidPart referred = ReferredTo(truth.part, 25);
  CHECK(referred.reference == 25);
  CHECK(Norm(ToVec3(referred.pose[25].rotation)) < 1e-12);
  const auto is_there = [&](const RigidPart& part, int64_t t) {
    bool same = true;
    for (size_t i = 0; i < part.points.size(); ++i) {
      const Vec3 there = part.Place(t, ToVec3(part.points[i].position));
      same = same && Norm(there - truth.part.Place(t, ToVec3(truth.part.points[i].position))) < 0.012;
    }
    return same;
  };
  for (int64_t t = 0; t < SwingingPart::kFrames; ++t) CHECK(is_there(referred, t));
  RigidPart part = ReferredTo(truth.part, 3);
  part.pose[3] = part.pose[35];
  part = ReferredTo(part, 3);  // all other frames are wrong beside frame 3, which is where frame 35 has it
  CHECK(FindLostAngles(truth.clip, truth.tracks, &part) == 1);
  CHECK(part.reference != 3);
  for (int64_t t = 0; t < SwingingPart::kFrames; ++t) CHECK(is_there(part, t));
}

TEST_CASE("a part on a hinge is where it was found where nothing tells better", "[hinge]") {
  const SwingingPart truth;
  RigidPart part = truth.part;
  CHECK(FindLostAngles(truth.clip, truth.tracks, &part) == 0);
  CHECK(part.seen == truth.part.seen);
  SwingingPart covered;
  for (const size_t t : {3, 20}) {  // nothing to be seen there
    covered.clip.gray[t] = torch::zeros_like(covered.clip.gray[t]);
    covered.part.pose[t] = covered.part.pose[35];
  }
  CHECK(FindLostAngles(covered.clip, covered.tracks, &covered.part) == 0);
  for (size_t t = 0; t < covered.part.seen.size(); ++t) CHECK(covered.part.seen[t] == (t != 3 && t != 20));
}

TEST_CASE("a part on a hinge is found in frames that did not see it, but for those that do not show it", "[hinge]") {
  SwingingPart truth;
  truth.clip.gray[25] = torch::zeros_like(truth.clip.gray[25]);
  RigidPart part = truth.part;
  for (const size_t t : {17, 18, 19, 25, 36}) {
    part.seen[t] = false;
    part.pose[t] = part.pose[0];
  }
  CHECK(FindLostAngles(truth.clip, truth.tracks, &part) == 4);
  CHECK_FALSE(part.seen[25]);
  for (const size_t t : {17, 18, 19, 36}) {
    INFO("frame " << t);
    CHECK(part.seen[t]);
    CHECK(Norm(ToVec3(part.pose[t].rotation) - ToVec3(truth.part.pose[t].rotation)) <= 0.03);
    CHECK(Norm(ToVec3(part.pose[t].translation) - ToVec3(truth.part.pose[t].translation)) <= 0.01);
  }
}

TEST_CASE("a part on a hinge stays where a few of its points are seen, too few to look for it", "[hinge]") {
  constexpr size_t kFrame = 20;
  const auto seen_through = [](int64_t half) {  // a window in what covers it, pixels
    SwingingPart covered;
    const RigidPose before = covered.part.pose[kFrame];
    const Projected top =
        Project(covered.clip.cameras[kFrame], covered.sphere.center(kFrame) + Vec3{0, 0, SwingingPart::kRadius});
    const auto u = static_cast<int64_t>(top.u), v = static_cast<int64_t>(top.v);
    const auto window = [&](const torch::Tensor& image) {
      return image.slice(0, v - half, v + half).slice(1, u - half, u + half);
    };
    const torch::Tensor gray = covered.clip.gray[kFrame];
    covered.clip.gray[kFrame] = torch::zeros_like(gray);
    window(covered.clip.gray[kFrame]).copy_(window(gray));
    CHECK(FindLostAngles(covered.clip, covered.tracks, &covered.part) == 0);
    CHECK(covered.part.pose[kFrame].rotation == before.rotation);
    return static_cast<bool>(covered.part.seen[kFrame]);
  };
  CHECK(seen_through(12));  // from three points on; a search asks for six
  CHECK_FALSE(seen_through(6));
}

TEST_CASE("where a part on a hinge is not seen it turns steadily from one side to the other", "[hinge]") {
  RigidPart part = SwingingPart().part;
  const std::vector<RigidPose> before = part.pose;
  for (const size_t t : {0, 18, 19, 20}) {
    part.pose[t] = {};
    part.seen[t] = false;
  }
  FillAngles(&part);
  for (size_t t = 0; t < part.pose.size(); ++t) {
    INFO("frame " << t);
    CHECK(part.pose[t].rotation[2] == Approx(before[t].rotation[2]).margin(1e-6));
    CHECK(Norm(ToVec3(part.pose[t].translation) - ToVec3(before[t].translation)) < 1e-4);
  }
}
