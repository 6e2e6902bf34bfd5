#include "libeditnerf/tracking/track_refinement.h"

#include <cmath>

#include "moving_spheres.h"
#include "tests/catch.h"

using namespace editnerf;

namespace {

// The top of a sliding sphere with noise on depth, and the sphere's exact flow in place of a measured one.
struct NoisyTrack {
  NoisyTrack() {
    options.frames = 40;
    options.width = 96;
    options.height = 72;
    rendered = RenderMovingSpheres({sphere}, options);
    const int64_t frames = options.frames;
    FlowSequence flows;
    flows.forward = torch::zeros({frames - 1, 72, 96, 2});
    flows.backward = torch::zeros({frames - 1, 72, 96, 2});
    flows.forward_valid = torch::ones({frames - 1, 72, 96}, torch::kBool);
    flows.backward_valid = torch::ones({frames - 1, 72, 96}, torch::kBool);
    for (int64_t t = 0; t + 1 < frames; ++t) {
      const Pixel a = PixelOf(t), b = PixelOf(t + 1);
      flows.forward[t].select(2, 0).fill_(b.u - a.u);
      flows.forward[t].select(2, 1).fill_(b.v - a.v);
      flows.backward[t].copy_(-flows.forward[t]);
    }
    clip = MakeClip(rendered.scene, rendered.maps.depth, flows);
    torch::manual_seed(3);
    const torch::Tensor noise = 0.04 * torch::randn({frames}, torch::kFloat64);
    pixels.reference_frame = 20;
    for (int64_t t = 0; t < frames; ++t) {
      const Pixel p = PixelOf(t);
      const Camera& camera = clip.cameras[static_cast<size_t>(t)];
      const double exact = Norm(Truth(t) - camera.position);
      const double distance = t == 20 ? exact : exact + noise[t].item<double>();
      pixels.pixel.push_back(p);
      pixels.visible.push_back(true);
      pixels.distance.push_back(distance);
      track.position.push_back(clip.Lift(t, p, distance));
      track.visible.push_back(true);
    }
  }

  Vec3 Truth(int64_t t) const { return sphere.center(t) + Vec3{0, -0.1, 0.17}; }
  Pixel PixelOf(int64_t t) const {
    const Projected p = Project(rendered.scene.frames[static_cast<size_t>(t)].camera, Truth(t));
    return {p.u, p.v};
  }
  double Error(const std::vector<Vec3>& positions) const {
    double sum = 0;
    for (size_t t = 0; t < positions.size(); ++t) {
      const Vec3 e = positions[t] - Truth(static_cast<int64_t>(t));
      sum += Dot(e, e);
    }
    return std::sqrt(sum / static_cast<double>(positions.size()));
  }

  ClipOptions options;
  Sphere sphere = Sliding({0, 0, 0.2}, {0.35, 0.1, 0}, 1, 40);
  MovingSpheres rendered;
  Clip clip;
  PixelTrack pixels;
  PointTrack track;
};

}  // namespace

TEST_CASE("refinement brings a track with noisy depth nearer to the truth") {
  const NoisyTrack noisy;
  RefinementOptions options;
  options.rounds = 1;
  const RefinedTrack refined = RefineTrack(noisy.clip, noisy.track, noisy.pixels, options);
  CHECK(refined.note.empty());
  CHECK(noisy.Error(refined.position) < 0.6 * noisy.Error(noisy.track.position));
  CHECK(refined.before.motion_terms == 39);
  CHECK(refined.before.geometry_terms == 40);
  CHECK(refined.after.motion < 0.5);
  CHECK(Norm(refined.position[20] - noisy.track.position[20]) < 0.02);
}

TEST_CASE("refinement carries a track through frames without evidence") {
  NoisyTrack noisy;
  for (size_t t = 25; t < 30; ++t) {
    noisy.pixels.visible[t] = noisy.track.visible[t] = false;
    noisy.pixels.distance[t] = NAN;
    noisy.track.position[t] = noisy.track.position[24];
  }
  const RefinedTrack refined = RefineTrack(noisy.clip, noisy.track, noisy.pixels);
  CHECK(refined.after.motion_terms == 33);
  CHECK(Norm(refined.position[27] - noisy.Truth(27)) < 0.08);
}

TEST_CASE("refinement survives tracks that stand still, lie on a line, or have no evidence at all") {
  NoisyTrack noisy;
  for (const int kind : {0, 1, 2, 3}) {
    PointTrack track = noisy.track;
    PixelTrack pixels = noisy.pixels;
    for (size_t t = 0; t < track.position.size(); ++t) {
      const auto s = static_cast<double>(t);
      if (kind == 0) track.position[t] = {0, 0, 0.2};
      if (kind == 1) track.position[t] = {0.01 * s, 0, 0.2};
      if (kind == 2) track.position[t] = {50 + s, -40, 0.2};  // outside every image, partly behind the cameras
      if (kind == 3) track.position[t] = noisy.clip.cameras[t].position;
      if (kind < 2) continue;
      track.visible[t] = pixels.visible[t] = false;
      pixels.distance[t] = NAN;
    }
    const RefinedTrack refined = RefineTrack(noisy.clip, track, pixels);
    INFO("kind " << kind);
    REQUIRE(refined.position.size() == 40);
    for (const Vec3& p : refined.position) CHECK((std::isfinite(p.x) && std::isfinite(p.y) && std::isfinite(p.z)));
    if (kind >= 2) CHECK(refined.after.motion_terms == 0);
  }
}

TEST_CASE("refinement survives tracks with fewer observations than unknowns, and cameras that all stand in one place") {
  NoisyTrack noisy;
  const auto frames = noisy.track.position.size();
  for (const char* kind : {"one frame", "one frame without depth", "one place", "one place without depth"}) {
    INFO(kind);
    const std::string text = kind;
    const bool one_frame = text.find("one frame") == 0, no_depth = text.find("without") != std::string::npos;
    Clip clip = noisy.clip;
    PointTrack track = noisy.track;
    PixelTrack pixels = noisy.pixels;
    for (size_t t = 0; t < frames; ++t) {
      // Turning does not tell how far anything is, and neither does a camera that does not even turn.
      if (!one_frame) clip.cameras[t] = clip.cameras[0];
      if (one_frame && t != 20) track.visible[t] = pixels.visible[t] = false;
      if (no_depth) pixels.distance[t] = NAN;
    }
    if (no_depth)
      for (torch::Tensor& map : clip.depth) map = torch::full_like(map, NAN);
    const RefinedTrack refined = RefineTrack(clip, track, pixels);
    REQUIRE(refined.position.size() == frames);
    for (size_t t = 0; t < frames; ++t) {
      CHECK(std::isfinite(Norm(refined.position[t])));
      // What nothing is known of stays about where it was: within the scene.
      CHECK(Norm(refined.position[t] - track.position[t]) < 1);
    }
    if (one_frame) CHECK(refined.after.motion_terms == 0);
    if (no_depth) CHECK(refined.after.geometry_terms == 0);
  }
}

TEST_CASE("refinement is deterministic and works on a whole detection") {
  const NoisyTrack noisy;
  Detection detection;
  detection.reference_frame = {20};
  detection.pixel_tracks = {noisy.pixels};
  detection.visible = torch::ones({40, 1}, torch::kBool);
  detection.tracks = torch::zeros({40, 1, 3});
  for (int64_t t = 0; t < 40; ++t) {
    const Vec3& p = noisy.track.position[static_cast<size_t>(t)];
    detection.tracks[t][0].copy_(torch::tensor({p.x, p.y, p.z}));
  }
  Detection again = detection;
  const auto report = RefineTracks(noisy.clip, &detection);
  RefineTracks(noisy.clip, &again);
  REQUIRE(report.size() == 1);
  CHECK(report[0].after.motion <= report[0].before.motion + 0.05);
  CHECK(torch::equal(detection.tracks, again.tracks));
}
