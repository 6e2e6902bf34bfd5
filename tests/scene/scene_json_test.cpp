#include "libeditnerf/scene/scene_json.h"

#include <torch/types.h>

#include <limits>
#include <nlohmann/json.hpp>

#include "libeditnerf/base/error.h"
#include "tests/catch.h"

using namespace editnerf;

TEST_CASE("a scene without its pixels survives the way through JSON") {
  Scene scene;
  scene.name = "cups";
  scene.transform = {0.3, {1, 2, 3}, 0.5, 2.5};
  for (int i = 0; i < 3; ++i) {
    SceneFrame frame{"f" + std::to_string(i), i, i, {}};
    frame.camera.position = {0.1 * i, -1e-7, 1.0 / 3.0};
    frame.camera.focal_length = 123.456;
    frame.camera.width = 64;
    frame.camera.height = 36;
    scene.frames.push_back(frame);
  }
  scene.train = {0, 1};
  scene.val = {2};
  const Scene back = SceneFromJson(SceneToJson(scene), "test");
  CHECK(back.name == scene.name);
  CHECK(back.transform.far == 2.5);
  CHECK(back.frames.size() == 3);
  CHECK(back.frames[1].camera.position.z == 1.0 / 3.0);
  CHECK(back.frames[2].warp_id == 2);
  CHECK(back.val == scene.val);
  CHECK_FALSE(back.points.defined());
  CHECK(SceneToJson(scene).find("points") == std::string::npos);
}

TEST_CASE("a scene's points survive the way through JSON to four digits") {
  Scene scene;
  scene.points = torch::tensor({0.0F, -1.23456F, 2e-7F, 0.1F, 12345.6F, -0.99996F}).view({2, 3});
  const std::string text = SceneToJson(scene);
  CHECK_THAT(text, HasText("[0.0,-1.235,2e-07]"));
  const Scene back = SceneFromJson(text, "test");
  REQUIRE(back.points.sizes() == scene.points.sizes());
  CHECK(back.points.scalar_type() == torch::kFloat32);
  CHECK(torch::allclose(back.points, scene.points, 5e-4, 0));
  CHECK(SceneToJson(back) == text);
}

TEST_CASE("of many points an even choice is kept, and none that is not finite") {
  Scene scene;
  const torch::Tensor x = torch::arange(9000, torch::kFloat32);
  scene.points = torch::stack({x, torch::ones_like(x), -x}, 1);
  scene.points[1][2] = std::numeric_limits<float>::quiet_NaN();
  scene.points[2][0] = std::numeric_limits<float>::infinity();
  const torch::Tensor points = SceneFromJson(SceneToJson(scene), "test").points;
  REQUIRE(points.size(0) == kMaxScenePoints);
  CHECK(points[0][0].item<float>() == 0);
  const torch::Tensor steps = points.slice(0, 1).select(1, 0) - points.slice(0, 0, -1).select(1, 0);
  CHECK(steps.min().item<float>() >= 4);
  CHECK(steps.max().item<float>() <= 7);  // past the two that are left out
  CHECK(points[-1][0].item<float>() > 8990);
}

TEST_CASE("points that are no points are refused by name") {
  nlohmann::json value = nlohmann::json::parse(SceneToJson(Scene()));
  const auto read = [&](const char* points) {
    value["points"] = nlohmann::json::parse(points);
    return SceneFromJson(value.dump(), "RUN");
  };
  CHECK_FALSE(read("[]").points.defined());
  CHECK(read("[[1, 2, 3]]").points.size(0) == 1);
  for (const char* points : {"null", "3", "{}", "\"\""}) {
    CHECK_THROWS_WITH(read(points), HasText("RUN: 'points': expected a list"));
  }
  for (const char* points : {"[1, 2, 3]", "[[1, 2]]", "[[1, 2, 3, 4]]", "[[1, 2, null]]", "[[1, 2, true]]",
                             "[[1, 2, 1e39]]", "[[1, 2, 3], [[], 0, 0]]", "[{\"a\": 1, \"b\": 2, \"c\": 3}]"}) {
    INFO(points);
    CHECK_THROWS_WITH(read(points), HasText("RUN: 'points': expected 3 finite numbers"));
  }
}

TEST_CASE("a damaged scene description is refused by name") {
  CHECK_THROWS_AS(SceneFromJson("{", "RUN/checkpoint"), DataError);
  CHECK_THROWS_WITH(SceneFromJson("{}", "RUN/checkpoint"), HasText("RUN/checkpoint: not a scene description"));
}
