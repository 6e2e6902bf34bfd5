// A sphere that slides, and a part that was fitted to tracks that drift on it.
#include "libeditnerf/tracking/part_alignment.h"

#include <torch/types.h>

#include "libeditnerf/base/percentile.h"
#include "libeditnerf/tracking/part_fit.h"
#include "tests/catch.h"
#include "tests/tracking/drifting_part.h"

using namespace editnerf;

namespace {

constexpr int64_t kReach = DriftingPart::kReach;

}  // namespace

TEST_CASE("points are followed by their looks for longer than flow went, and do not drift", "[alignment]") {
  const DriftingPart drifting;
  std::vector<double> misses;
  size_t aligned = 0;
  for (size_t i = 0; i < drifting.part.points.size(); ++i) {
    const std::vector<FlowTrack> runs =
        AlignPoint(drifting.clip, drifting.tracks, drifting.part, drifting.part.points[i]);
    aligned += !runs.empty();
    for (const FlowTrack& run : runs) {
      CHECK_FALSE(run.chained);
      CHECK(run.pixel.size() <= runs.front().pixel.size());
      for (int64_t t = run.first; t < run.end(); ++t)
        misses.push_back(Distance(run.At(t), drifting.Truth(drifting.normals[i], t)));
    }
  }
  CHECK(aligned > drifting.part.points.size() / 3);  // the others have no corner
  CHECK(misses.size() > aligned * 2 * (2 * kReach + 1));
  CHECK(Percentile(misses, 0.5) < 0.2);
  CHECK(Percentile(misses, 0.9) < 1);
}

TEST_CASE("patches find out how their surface lies, where the points around make out another", "[alignment]") {
  DriftingPart drifting;
  const RigidPart part = drifting.part;
  std::vector<double> misses;
  for (size_t i = 0; i < part.points.size(); ++i) {
    // A third of the sphere's radius to and fro, as the next points are.
    const Vec3 towards = Normalized(drifting.clip.cameras[DriftingPart::kFrames / 2].position - part.center);
    for (size_t k = 0; k < part.points.size(); ++k) {
      const double off = k == i ? 0 : (k % 2 == 0 ? 1 : -1) * DriftingPart::kRadius / 3;
      drifting.part.points[k].position = ToArray(ToVec3(part.points[k].position) + towards * off);
    }
    for (const FlowTrack& run : AlignPoint(drifting.clip, drifting.tracks, drifting.part, drifting.part.points[i]))
      for (int64_t t = run.first; t < run.end(); ++t)
        misses.push_back(Distance(run.At(t), drifting.Truth(drifting.normals[i], t)));
  }
  CHECK(misses.size() > part.points.size() * 12);
  CHECK(Percentile(misses, 0.5) < 0.2);
  CHECK(Percentile(misses, 0.9) < 1);
}

TEST_CASE("a part that drifted with its tracks is where it belongs once it is aligned", "[alignment]") {
  DriftingPart drifting;
  PartSolverOptions options;
  options.flow_pixels = 0.4;
  PartFit fit(drifting.clip, drifting.tracks, options, {0.5, 5});
  fit.GoOn(drifting.part);
  const double before = drifting.Astray(fit.part());
  for (int round = 0; round < 3; ++round) {
    REQUIRE(fit.Align(&drifting.tracks));
    fit.Settle();
  }
  CHECK(before > 0.02);  // four pixels
  CHECK(drifting.Astray(fit.part()) < 0.6 * before);
  CHECK(fit.part().points.size() > drifting.part.points.size() / 2);
  for (const RigidPose& pose : fit.part().pose) CHECK(Norm(ToVec3(pose.rotation)) == 0);  // it does not begin to turn
}

TEST_CASE("a point without a corner to hold on to is not aligned", "[alignment]") {
  DriftingPart drifting;
  for (torch::Tensor& gray : drifting.clip.gray) gray = torch::arange(320.0F).repeat({240, 1});  // a ramp
  CHECK(AlignPoint(drifting.clip, drifting.tracks, drifting.part, drifting.part.points.front()).empty());
  for (torch::Tensor& gray : drifting.clip.gray) gray = torch::zeros({240, 320});
  CHECK(AlignPoint(drifting.clip, drifting.tracks, drifting.part, drifting.part.points.front()).empty());
}
