#include "libeditnerf/scene/scene_json.h"

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
}

TEST_CASE("a damaged scene description is refused by name") {
  CHECK_THROWS_AS(SceneFromJson("{", "RUN/checkpoint"), DataError);
  CHECK_THROWS_WITH(SceneFromJson("{}", "RUN/checkpoint"), HasText("RUN/checkpoint: not a scene description"));
}
