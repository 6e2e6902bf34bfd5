#include "libeditnerf/scene/synthetic/tracer.h"

#include <algorithm>

#include "libeditnerf/scene/synthetic/camera_path.h"
#include "libeditnerf/scene/synthetic/motion.h"
#include "tests/catch.h"

using namespace editnerf;
using namespace editnerf::synthetic;

namespace {

Material White() {
  Material material;
  material.texture.first = {0.7, 0.7, 0.7};
  material.specular = 0;
  return material;
}

// A ball above a white floor under a lamp: grey levels along a row of pixels through its shadow.
std::vector<int> ShadowRow(double ball_x, double light_radius) {
  const std::vector<Body> bodies = {{"floor", {Disk(0, 20, White())}, false}, {"ball", {Sphere(0.4, White())}, true}};
  Light light = {{0, 0, 6}, {0, 0, 0}};
  light.radius = light_radius;
  const PlacedStage stage(bodies, {{}, {{}, {ball_x, 0, 2}}}, light);
  Camera camera;
  camera.orientation = {{1, 0, 0, 0, 0, -1, 0, 1, 0}};  // along +y
  camera.position = {0, -8, 3};
  camera.orientation = camera.orientation * RotationX(std::atan2(3.0, 8.0));  // down to the origin
  camera.width = 64;
  camera.height = 9;
  camera.focal_length = 110;
  camera.principal_point = {32, 4.5};
  const View view = RenderView(stage, camera, 4, 1);
  std::vector<int> row;
  for (size_t x = 0; x < 64; ++x) row.push_back(view.rgb[3 * (4 * 64 + x)]);
  return row;
}

int64_t Between(const std::vector<int>& row, int low, int high) {
  return std::count_if(row.begin(), row.end(), [&](int value) { return value > low && value < high; });
}

}  // namespace

TEST_CASE("rays meet every shape on its surface, from outside and from inside") {
  const Material material = White();
  const Shape shapes[] = {Box({0.5, 0.3, 0.2}, material), Sphere(0.6, material), Frustum(0.5, 0.3, 0.8, material),
                          Disk(0.1, 0.7, material)};
  for (const Shape& shape : shapes) {
    INFO(static_cast<int>(shape.kind));
    int hits = 0;
    for (uint64_t k = 0; k < 400; ++k) {
      const auto random = [&](uint64_t channel) { return 2 * HashUnit(k, channel) - 1; };
      const Vec3 origin = (k % 2 == 0 ? 2.0 : 0.1) * Vec3{random(1), random(2), random(3)};
      const Vec3 target = 0.4 * Vec3{random(4), random(5), random(6)};
      const Ray ray = {origin, Normalized(target - origin)};
      const double distance = Intersect(shape, ray, 1e-6);
      if (distance < 0) continue;
      ++hits;
      const Vec3 p = ray.At(distance);
      CHECK(Norm(p - shape.BoundingCenter()) <= shape.BoundingRadius() + 1e-9);
      CHECK(Norm(NormalAt(shape, p)) == Approx(1));
      double off = 0;
      switch (shape.kind) {
        case Shape::Kind::kBox:
          off = std::max({std::abs(p.x) - 0.5, std::abs(p.y) - 0.3, std::abs(p.z) - 0.2});
          break;
        case Shape::Kind::kSphere:
          off = Norm(p) - 0.6;
          break;
        case Shape::Kind::kFrustum:
          off = std::hypot(p.x, p.y) - (0.5 - 0.25 * p.z);
          break;
        case Shape::Kind::kDisk:
          off = p.z;
          break;
      }
      CHECK(std::abs(off) < 1e-9);
    }
    CHECK(hits > 60);
  }
}

TEST_CASE("a surface seen from inside alone lets rays in and casts no shadow") {
  Body backdrop = {"", {Frustum(1, 1, 4, White())}, false};
  backdrop.shapes[0].inside_only = true;
  const std::vector<Body> bodies = {backdrop};
  const PlacedStage stage(bodies, {{}}, Light{});
  CHECK(stage.Trace({{-3, 0, 1}, {1, 0, 0}}).distance == Approx(4));
  CHECK_FALSE(stage.Occluded({0, 0, 1}, {5, 0, 1}));
}

TEST_CASE("shadows follow the object that casts them and are soft at their edges") {
  const std::vector<int> left = ShadowRow(-0.6, 0.6), right = ShadowRow(0.6, 0.6), hard = ShadowRow(-0.6, 1e-3);
  const int lit = *std::max_element(left.begin(), left.end()), dark = *std::min_element(left.begin(), left.end());
  REQUIRE(lit - dark > 60);
  const auto darkest = [](const std::vector<int>& row) {
    return std::min_element(row.begin(), row.end()) - row.begin();
  };
  CHECK(darkest(left) + 10 < darkest(right));
  CHECK(Between(left, dark + 12, lit - 25) > Between(hard, dark + 12, lit - 25) + 3);
}

TEST_CASE("finer sampling changes a synthetic picture by less than one part in a hundred") {
  const std::vector<Body> bodies = {{"floor", {Disk(0, 20, White())}, false},
                                    {"ball", {Sphere(0.5, White(), {0, 0, 1})}, true}};
  const PlacedStage stage(bodies, {{}, {}}, Light{{-2, -2, 4}, {0, 0, 0}});
  CameraPathOptions path;
  path.width = 160;
  path.height = 90;
  const Camera camera = TrainingCamera(path, 0.3);
  const View usual = RenderView(stage, camera, 4, 1), fine = RenderView(stage, camera, 9, 2);
  double sum = 0;
  for (size_t i = 0; i < usual.rgb.size(); ++i) sum += std::pow((usual.rgb[i] - fine.rgb[i]) / 255.0, 2);
  CHECK(std::sqrt(sum / static_cast<double>(usual.rgb.size())) < 0.01);  // 40 dB
}

TEST_CASE("the synthetic camera sweeps an arc without roll and keeps the focus in view") {
  CameraPathOptions path;
  path.width = 64;
  path.height = 36;
  double low = 1e9, high = -1e9;
  for (int k = 0; k <= 100; ++k) {
    const double t = k / 100.0;
    for (const Camera& camera : {TrainingCamera(path, t), NovelCamera(path, t, static_cast<uint64_t>(k))}) {
      camera.Check("camera");
      CHECK(std::abs(camera.orientation(0, 2)) < 1e-12);  // the picture's rows are level
      const Projected focus = Project(camera, path.focus);
      CHECK(std::abs(focus.u - 32) < 6);
      CHECK(std::abs(focus.v - 18) < 6);
    }
    const Vec3 offset = TrainingCamera(path, t).position - path.focus;
    const double azimuth = std::atan2(offset.x, -offset.y);
    low = std::min(low, azimuth), high = std::max(high, azimuth);
  }
  CHECK(high - low > 1.05);  // 60 degrees
  CHECK(high - low < 1.4);   // 80 degrees
}

TEST_CASE("tracks ease between key frames and rest where two are equal") {
  const std::vector<Track> tracks = {{{0.2, {0}}, {0.4, {1}}, {0.6, {1}}}, {{0, {5, 6}}}};
  CHECK(StateAt(tracks, 0) == State{0, 5, 6});
  CHECK(StateAt(tracks, 0.3)[0] == Approx(0.5));
  CHECK(StateAt(tracks, 0.21)[0] < 0.01);
  CHECK(StateAt(tracks, 0.5)[0] == 1);
  CHECK(StateAt(tracks, 2) == State{1, 5, 6});
}

TEST_CASE("unseen states combine what parts did at different times") {
  const std::vector<Track> tracks = {{{0, {0, 0}}}, {{0, {0}}}};
  const std::vector<State> visited = {{0, 0, 0}, {1, 0, 0}, {1, 0, 1}, {0, 0, 1}};
  const std::vector<State> unseen = UnseenStates(visited, tracks, 3, 0);
  REQUIRE(unseen.size() == 3);
  for (const State& state : unseen) {
    CHECK(state[1] == 0);
    for (const State& other : visited) CHECK(StateDistance(state, other) > 0.2);
  }
}
