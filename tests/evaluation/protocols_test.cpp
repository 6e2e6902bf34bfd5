#include "libeditnerf/evaluation/protocols.h"

#include <torch/types.h>

#include <cmath>

#include "libeditnerf/base/error.h"
#include "tests/catch.h"

using namespace editnerf;

namespace {

constexpr int64_t kHeight = 6, kWidth = 8;

// Training frames with warp ids 0, 4, 10 (frames 0 to 2), validation frames with the given ids, one edit frame; a
// camera at the origin that looks along z with its centre in the middle; object 0 turns about z, object 1 moves along
// x.
Scene MakeScene(const std::vector<int64_t>& val_warp_ids) {
  Scene scene;
  scene.name = "hand-made";
  Camera camera;
  camera.focal_length = 4;
  camera.principal_point = {kWidth / 2.0, kHeight / 2.0};
  camera.width = kWidth;
  camera.height = kHeight;
  const auto add = [&](int64_t warp_id) {
    const auto index = static_cast<int64_t>(scene.frames.size());
    scene.frames.push_back({std::to_string(index), warp_id, warp_id, camera});
    return index;
  };
  for (const int64_t id : {0, 4, 10}) scene.train.push_back(add(id));
  for (const int64_t id : val_warp_ids) scene.val.push_back(add(id));
  scene.edit.push_back(add(-1));

  const auto count = static_cast<int64_t>(scene.frames.size());
  scene.images = torch::zeros({count, kHeight, kWidth, 3}, torch::kUInt8);
  GroundTruth truth;
  truth.objects = {"disk", "slider"};
  truth.scene_from_object = torch::eye(4, torch::kFloat64).repeat({count, 2, 1, 1});
  for (int64_t f = 0; f < count; ++f) {
    const double angle = 0.3 * static_cast<double>(f);
    auto disk = truth.scene_from_object[f][0];
    disk[0][0] = disk[1][1] = 0.5 * std::cos(angle);  // in scene units: with the scene's scale
    disk[1][0] = 0.5 * std::sin(angle);
    disk[0][1] = -0.5 * std::sin(angle);
    disk[2][2] = 0.5;
    truth.scene_from_object[f][1][0][3] = 0.25 * static_cast<double>(f);
  }
  truth.mask = torch::zeros({count, kHeight, kWidth}, torch::kUInt8);
  truth.mask.slice(2, 0, 4) = 1;
  truth.mask.slice(2, 6, 8) = 2;
  scene.truth = truth;
  return scene;
}

}  // namespace

TEST_CASE("a key point belongs to the object at its pixel, rounded down") {
  const Scene scene = MakeScene({});
  const auto at = [&](double u, double v) { return ObjectAt(scene, 0, {(u - 4) / 4 * 2, (v - 3) / 4 * 2, 2}); };
  CHECK(at(0.01, 0.01) == 0);
  CHECK(at(3.99, 5.99) == 0);
  CHECK(at(4.01, 3) == kStaticObject);
  CHECK(at(6.5, 3) == 1);
  CHECK(at(-0.01, 3) == kStaticObject);
  CHECK(at(8.01, 3) == kStaticObject);
  CHECK(at(3, 6.01) == kStaticObject);
  CHECK(ObjectAt(scene, 0, {0, 0, -2}) == kStaticObject);
  CHECK(ObjectAt(scene, 0, {std::nan(""), 0, 2}) == kStaticObject);
}

TEST_CASE("true key points move with their objects, and stay where nothing moves") {
  const Scene scene = MakeScene({});
  const std::vector<ReferenceKeyPoint> key_points = {
      {{0.4, 0.1, 1.5}, 1, 0}, {{0.9, 0, 2}, 2, 1}, {{0.1, 0.2, 3}, 0, kStaticObject}};
  const auto there = TrueKeyPoints(scene, key_points, 3);
  const double c = std::cos(0.6), s = std::sin(0.6);
  const auto expected = torch::tensor(
      {{0.4 * c - 0.1 * s, 0.4 * s + 0.1 * c, 1.5}, {0.9 + 0.25, 0.0, 2.0}, {0.1, 0.2, 3.0}}, torch::kFloat64);
  CHECK(torch::allclose(there, expected, 1e-12, 1e-12));
  CHECK(torch::allclose(TrueKeyPoints(scene, {key_points[0]}, 1), torch::tensor({{0.4, 0.1, 1.5}}, torch::kFloat64)));
}

TEST_CASE("key points get the objects of their reference frames") {
  const Scene scene = MakeScene({});
  const auto key_points = WithObjects(scene, torch::tensor({{-0.5, 0.0, 2.0}, {1.4, 0.0, 2.0}}), {1, 2});
  REQUIRE(key_points.size() == 2);
  CHECK(key_points[0].object == 0);
  CHECK(key_points[0].frame == 1);
  CHECK(key_points[1].object == 1);
  CHECK(key_points[1].position.x == Approx(1.4));
}

TEST_CASE("the editing protocol needs ground truth, and a consistent one") {
  Scene scene = MakeScene({});
  scene.truth->mask.fill_(3);
  CHECK_THROWS_WITH(ObjectAt(scene, 2, {0, 0, 2}),
                    "hand-made: gt/mask of frame 2 holds 3, but gt/motion.json names 2 objects");
  CHECK_THROWS_AS(ObjectAt(scene, 4, {0, 0, 2}), DataError);
  CHECK_THROWS_AS(TrueKeyPoints(scene, {{{0, 0, 1}, 0, 2}}, 0), DataError);
  scene.truth.reset();
  CHECK_THROWS_WITH(
      ObjectAt(scene, 0, {0, 0, 2}),
      "hand-made: no ground truth (gt/), which the editing protocol needs; only synthetic scenes have it");
}

TEST_CASE("the nearest training frame is the one with the least mean square distance") {
  auto tracks = torch::zeros({4, 2, 3}, torch::kFloat64);
  for (int64_t t = 0; t < 4; ++t) tracks[t][0][0] = static_cast<double>(t);
  tracks[2][1][2] = 2;
  auto key_points = torch::zeros({2, 3});
  key_points[0][0] = 2.0f;
  const NearestFrame nearest = NearestTrainingFrame(tracks, key_points);
  CHECK(nearest.train_index == 1);  // 1 and 3 are equally near
  CHECK(nearest.distance == Approx(std::sqrt(0.5)));
  key_points[1][2] = 2.0f;
  CHECK(NearestTrainingFrame(tracks, key_points).train_index == 2);
  CHECK(NearestTrainingFrame(tracks, key_points).distance == 0);
  CHECK_THROWS_AS(NearestTrainingFrame(tracks, torch::zeros({3, 3})), ShapeError);
  CHECK_THROWS_AS(NearestTrainingFrame(torch::zeros({0, 2, 3}), key_points), ShapeError);
}
