// A sphere that slides, and a part that was fitted to tracks that drift on it.
#include "libeditnerf/tracking/part_alignment.h"

#include <torch/torch.h>

#include <algorithm>

#include "libeditnerf/base/percentile.h"
#include "libeditnerf/tracking/part_fit.h"
#include "tests/catch.h"
#include "tests/tracking/moving_spheres.h"

using namespace editnerf;

namespace {

constexpr int64_t kFrames = 40;
constexpr double kRadius = 0.25;
constexpr double kTrackDrift = 0.15;  // pixels a frame
constexpr int64_t kReach = 6;         // frames before and after the middle of a track

struct DriftingPart {
  Sphere sphere = {kRadius, [](int64_t t) {  // rests, slides, and rests
                     const double share = std::clamp((static_cast<double>(t) - 14) / 10, 0.0, 1.0);
                     return Vec3{0.3 * share - 0.15, 0, 0.35};
                   }};
  Clip clip;
  std::vector<FlowTrack> tracks;
  RigidPart part;
  std::vector<Vec3> normals;  // of the sphere at the part's points

  DriftingPart() {
    const ClipOptions options = {kFrames, 320, 240, 0.6, 0, 0};
    clip = ClipWithoutFlow(RenderMovingSpheres({sphere}, options));
    part.center = sphere.center(0);
    for (int64_t t = 0; t < kFrames; ++t) {
      part.pose.push_back({{0, 0, 0}, ToArray(sphere.center(t) - sphere.center(0) + Slip(t))});
      part.seen.push_back(true);
    }
    const Vec3 towards = Normalized(clip.cameras[kFrames / 2].position - sphere.center(kFrames / 2));
    const Vec3 side = Normalized(Cross(towards, {0, 0, 1})), up = Cross(side, towards);
    for (int i = -3; i <= 3; ++i) {
      for (int j = -3; j <= 3; ++j) AddPoint(Normalized(towards + side * (0.2 * i) + up * (0.2 * j)));
    }
  }

  Vec3 Slip(int64_t t) const { return clip.cameras[0].orientation.Row(0) * (6e-4 * static_cast<double>(t)); }

  void AddPoint(const Vec3& normal) {
    const int64_t middle = 8 + static_cast<int64_t>(5 * tracks.size() % 24);
    FlowTrack track = {middle - kReach, middle, {}};
    for (int64_t t = middle - kReach; t <= middle + kReach; ++t) {
      const Pixel at = Truth(normal, t);
      track.pixel.push_back({at.u + kTrackDrift * static_cast<double>(t - middle), at.v});
    }
    part.points.push_back({{tracks.size()}, ToArray(sphere.center(0) + normal * kRadius - Slip(middle))});
    tracks.push_back(track);
    normals.push_back(normal);
  }

  Pixel Truth(const Vec3& normal, int64_t t) const {
    const Projected at = Project(clip.cameras[static_cast<size_t>(t)], sphere.center(t) + normal * kRadius);
    return {at.u, at.v};
  }

  // How far its way leads from the sphere's, scene units.
  double Astray(const RigidPart& of) const {
    double most = 0;
    for (int64_t t = 0; t < kFrames; ++t) {
      const Vec3 way = of.Place(t, of.center) - of.Place(0, of.center);
      most = std::max(most, Norm(way - (sphere.center(t) - sphere.center(0))));
    }
    return most;
  }
};

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
  for (const RigidPose& pose : fit.part().pose) CHECK(Norm(ToVec3(pose.rotation)) == 0);  // turns stay left out
}

TEST_CASE("a point without a corner to hold on to is not aligned", "[alignment]") {
  DriftingPart drifting;
  for (torch::Tensor& gray : drifting.clip.gray) gray = torch::arange(320.0F).repeat({240, 1});  // a ramp
  CHECK(AlignPoint(drifting.clip, drifting.tracks, drifting.part, drifting.part.points.front()).empty());
  for (torch::Tensor& gray : drifting.clip.gray) gray = torch::zeros({240, 320});
  CHECK(AlignPoint(drifting.clip, drifting.tracks, drifting.part, drifting.part.points.front()).empty());
}
