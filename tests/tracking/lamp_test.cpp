#include "libeditnerf/tracking/lamp.h"

#include <torch/types.h>

#include <cmath>

#include "libeditnerf/tracking/steady_places.h"
#include "tests/catch.h"
#include "tests/tracking/moving_spheres.h"

using namespace editnerf;

namespace {

// Every third pixel of every frame: those of the floor stand still, and key points carry the others.
DepthTargets PlacesOf(const MovingSpheres& rendered, bool on_floor) {
  std::vector<int64_t> frame, pixel, key_point;
  std::vector<float> distance;
  for (int64_t t = 0; t < rendered.part.size(0); ++t) {
    for (int64_t row = 1; row < rendered.part.size(1); row += 3) {
      for (int64_t column = 1; column < rendered.part.size(2); column += 3) {
        const auto part = rendered.part[t][row][column].item<int64_t>();
        if ((part < 0) != on_floor) continue;
        frame.push_back(t), pixel.push_back(column), pixel.push_back(row);
        key_point.push_back(on_floor ? kStandsStill : part);
        distance.push_back(rendered.maps.depth[t][row][column].item<float>());
      }
    }
  }
  const auto count = static_cast<int64_t>(frame.size());
  return {torch::tensor(frame, torch::kInt64), torch::tensor(pixel, torch::kInt64).view({count, 2}),
          torch::tensor(distance), torch::full({count}, 0.01F), torch::tensor(key_point, torch::kInt64)};
}

// Two spheres that rise and slide, each at its own pace.
std::vector<Sphere> TwoSpheres() {
  const auto at = [](const Vec3& center, double height, double width, double cycles) {
    return Sphere{0.13, [=](int64_t t) {
                    const double angle = 2 * M_PI * cycles * static_cast<double>(t) / 30;
                    return center + Vec3{width * std::sin(0.7 * angle), 0, height * (1 - std::cos(angle))};
                  }};
  };
  return {at({-0.25, 0, 0.2}, 0.15, 0.2, 2), at({0.3, -0.1, 0.25}, 0.1, -0.15, 3)};
}

torch::Tensor TracksOf(const std::vector<Sphere>& spheres, int64_t frames) {
  torch::Tensor tracks = torch::zeros({frames, static_cast<int64_t>(spheres.size()), 3});
  for (int64_t t = 0; t < frames; ++t) {
    for (size_t n = 0; n < spheres.size(); ++n) {
      const Vec3 at = spheres[n].center(t);
      tracks[t][static_cast<int64_t>(n)] = torch::tensor({at.x, at.y, at.z}).to(torch::kFloat32);
    }
  }
  return tracks;
}

std::optional<Lamp> LampOf(const std::optional<Vec3>& truth) {
  ClipOptions options;
  options.lamp = truth;
  const MovingSpheres rendered = RenderMovingSpheres(TwoSpheres(), options);
  const Clip clip = ClipWithoutFlow(rendered);
  DepthTargets still = PlacesOf(rendered, true);
  const DepthTargets parts = PlacesOf(rendered, false);
  MarkUnsteadyPlaces(clip, parts, &still);
  return FindLamp(clip, still, parts, TracksOf(TwoSpheres(), options.frames));
}

}  // namespace

TEST_CASE("shadows of two parts that rise and slide tell where the light comes from") {
  for (const Vec3& truth : {Normalized({0.5, 0.2, 1}), Normalized({-0.6, -0.5, 0.9})}) {
    const std::optional<Lamp> lamp = LampOf(truth);
    REQUIRE(lamp.has_value());
    INFO(lamp->direction.x << ", " << lamp->direction.y << ", " << lamp->direction.z << " instead of " << truth.x
                           << ", " << truth.y << ", " << truth.z << "; explained " << lamp->explained);
    CHECK(Norm(lamp->direction) == Approx(1));
    CHECK(Dot(lamp->direction, truth) > std::cos(8 * M_PI / 180));
    CHECK(lamp->explained > 0.3);
  }
}

TEST_CASE("where nothing casts a shadow there is no lamp") {
  CHECK(!LampOf(std::nullopt));
  CHECK(!FindLamp(Clip(), {}, {}, torch::zeros({3, 2, 3})));
}
