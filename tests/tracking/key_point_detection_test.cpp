#include "libeditnerf/tracking/key_point_detection.h"

#include <algorithm>
#include <cmath>
#include <set>

#include "libeditnerf/base/error.h"

#include "moving_spheres.h"
#include "tests/catch.h"

using namespace editnerf;

namespace {

DetectionConfig SmallConfig() {
  DetectionConfig config;
  config.rigid_parts = false;
  config.volume_resolution = 48;
  config.min_observations = 3;
  config.skip_interval = 15;
  return config;
}

Detection Detect(const MovingSpheres& clip, const DetectionConfig& config) {
  const DisFlow flow;
  return DetectKeyPoints(clip.scene, clip.maps, ComputeFlowSequence(clip.scene.images, flow), flow, config);
}

bool Mentions(const Detection& detection, const std::string& words) {
  for (const std::string& note : detection.notes)
    if (note.find(words) != std::string::npos) return true;
  return false;
}

// Mean distance of the visible track from the sphere's true motion, scene units.
double TrackError(const Detection& detection, int64_t n, const Sphere& sphere) {
  const int64_t reference = detection.reference_frame[static_cast<size_t>(n)];
  double sum = 0, count = 0;
  for (int64_t t = 0; t < detection.tracks.size(0); ++t) {
    if (!detection.visible[t][n].item<bool>()) continue;
    const Vec3 truth = RowOf(detection.reference, n) + sphere.center(t) - sphere.center(reference);
    sum += Norm(RowOf(detection.tracks[t], n) - truth);
    count += 1;
  }
  return sum / count;
}

}  // namespace

TEST_CASE("one moving part gets one key point that follows it") {
  const std::vector<Sphere> spheres = {Sliding({0, 0, 0.2}, {0.35, 0.1, 0}, 1, 30)};
  const MovingSpheres clip = RenderMovingSpheres(spheres);
  const Detection detection = Detect(clip, SmallConfig());
  for (const auto& note : detection.notes) UNSCOPED_INFO(note);
  REQUIRE(detection.count() == 1);
  CHECK(clip.PartAt(detection.reference_frame[0], RowOf(detection.reference, 0)) == 0);
  CHECK(detection.tracks.size(0) == 30);
  CHECK(detection.visible.sum().item<int64_t>() >= 20);
  CHECK(TrackError(detection, 0, spheres[0]) < 0.05);
  CHECK(detection.score[0].item<double>() > 0);
}

TEST_CASE("two parts that move independently get one key point each") {
  const std::vector<Sphere> spheres = {Sliding({-0.45, 0, 0.2}, {0, 0.3, 0}, 1, 30),
                                       Sliding({0.45, 0, 0.2}, {0, 0.05, 0.2}, 1.5, 30)};
  const MovingSpheres clip = RenderMovingSpheres(spheres);
  const Detection detection = Detect(clip, SmallConfig());
  for (const auto& note : detection.notes) UNSCOPED_INFO(note);
  REQUIRE(detection.count() == 2);
  std::set<int64_t> parts;
  for (int64_t n = 0; n < 2; ++n) {
    const int64_t part = clip.PartAt(detection.reference_frame[static_cast<size_t>(n)], RowOf(detection.reference, n));
    parts.insert(part);
    if (part >= 0) CHECK(TrackError(detection, n, spheres[static_cast<size_t>(part)]) < 0.06);
  }
  CHECK(parts == std::set<int64_t>{0, 1});
}

TEST_CASE("a part that rests nearly all the time is found where it goes away and comes back") {
  constexpr int64_t kFrames = 40;
  Sphere sphere = Resting({0, 0, 0.2});
  sphere.center = [](int64_t t) {
    const double way = std::clamp(1 - std::abs(static_cast<double>(t) - 20) / 4, 0.0, 1.0);
    return Vec3{0.4 * way - 0.2, 0.1 * way, 0.2};
  };
  ClipOptions options;
  options.frames = kFrames;
  const MovingSpheres clip = RenderMovingSpheres({sphere}, options);
  DetectionConfig config = SmallConfig();
  config.rigid_parts = true;
  const Detection detection = Detect(clip, config);
  for (const auto& note : detection.notes) UNSCOPED_INFO(note);
  REQUIRE(detection.count() == 1);
  CHECK(clip.PartAt(detection.reference_frame[0], RowOf(detection.reference, 0)) == 0);
  CHECK(TrackError(detection, 0, sphere) < 0.05);
}

TEST_CASE("a static scene gets no key point and a note that says so") {
  const MovingSpheres clip = RenderMovingSpheres({Resting({0.1, 0, 0.2})});
  const Detection detection = Detect(clip, SmallConfig());
  for (const auto& note : detection.notes) UNSCOPED_INFO(note);
  CHECK(detection.count() == 0);
  CHECK(detection.tracks.sizes() == torch::IntArrayRef({30, 0, 3}));
  CHECK(Mentions(detection, "no moving part found"));
}

TEST_CASE("detection is deterministic and survives frames without any surface") {
  MovingSpheres clip = RenderMovingSpheres({Sliding({0, 0, 0.2}, {0.35, 0.1, 0}, 1, 30)});
  clip.maps.depth[10].fill_(NAN);
  clip.maps.depth.slice(1, 0, 20).fill_(NAN);
  clip.maps.ambient[4].fill_(NAN);
  const Detection a = Detect(clip, SmallConfig()), b = Detect(clip, SmallConfig());
  REQUIRE(a.count() == 1);
  CHECK_FALSE(a.visible[10][0].item<bool>());
  CHECK(torch::isfinite(a.tracks).all().item<bool>());
  CHECK(torch::equal(a.tracks, b.tracks));
  CHECK(torch::equal(a.visible, b.visible));
  CHECK(a.notes == b.notes);
}

TEST_CASE("duplicates on one part are merged, and a given count brings them back") {
  const MovingSpheres clip = RenderMovingSpheres({Sliding({0, 0, 0.3}, {0.25, 0.1, 0}, 1, 30, 0.3)});
  DetectionConfig config = SmallConfig();
  config.volume_resolution = 64;
  config.smoothing = 0.6;
  config.min_distance = 0.04;
  config.relative_threshold = 0.1;
  const Detection merged = Detect(clip, config);
  for (const auto& note : merged.notes) UNSCOPED_INFO(note);
  CHECK(merged.candidates.size() > 1);
  CHECK(merged.count() == 1);
  config.count = 2;
  const Detection forced = Detect(clip, config);
  CHECK(forced.count() == 2);
  CHECK(Mentions(forced, "kept because the number of key points is given"));
  config.count = 8;
  config.min_distance = 0.9;
  CHECK_THROWS_WITH(Detect(clip, config), HasText("detect.count asks for 8 key points, but only 1 places") &&
                                              HasText("lower detect.relative_threshold and detect.min_distance"));
}

TEST_CASE("a part that passes behind another is marked invisible there and found again") {
  const int64_t frames = 40;
  ClipOptions options;
  options.frames = frames;
  const std::vector<Sphere> spheres = {Sliding({-0.15, 0.25, 0.2}, {0.6, 0, 0}, 0.5, frames, 0.2),
                                       Resting({0.08, -0.9, 0.97}, 0.08)};
  const MovingSpheres clip = RenderMovingSpheres(spheres, options);
  const Detection detection = Detect(clip, SmallConfig());
  for (const auto& note : detection.notes) UNSCOPED_INFO(note);
  REQUIRE(detection.count() >= 1);
  CHECK(clip.PartAt(detection.reference_frame[0], RowOf(detection.reference, 0)) == 0);
  const auto is_hidden = [&](int64_t t) {
    const Vec3 moved = spheres[0].center(t) - spheres[0].center(detection.reference_frame[0]);
    return clip.PartAt(t, RowOf(detection.reference, 0) + moved) == 1;
  };
  int64_t wrong = 0, hidden = 0, seen = 0;
  for (int64_t t = 0; t < frames; ++t) {
    const bool visible = detection.visible[t][0].item<bool>();
    if (visible) ++seen;
    if (!is_hidden(t)) continue;
    ++hidden;
    // At the other's edge the part is still within the window in which depth is looked up.
    const bool at_edge = t == 0 || t + 1 == frames || !is_hidden(t - 1) || !is_hidden(t + 1);
    if (visible && !at_edge) ++wrong;
  }
  CHECK(seen >= frames / 2);
  CHECK(hidden >= 2);
  CHECK(wrong <= hidden / 4);
  CHECK(TrackError(detection, 0, spheres[0]) < 0.06);
}

TEST_CASE("maps of another size than the images are refused") {
  MovingSpheres clip = RenderMovingSpheres({Resting({0, 0, 0.2})}, {4, 64, 48});
  const DisFlow flow;
  const FlowSequence flows = ComputeFlowSequence(clip.scene.images, flow);
  clip.maps.depth = clip.maps.depth.slice(2, 0, 32);
  CHECK_THROWS_AS(DetectKeyPoints(clip.scene, clip.maps, flows, flow, {}), DataError);
}
