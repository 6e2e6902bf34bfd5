#include "libeditnerf/server/session_json.h"

#include "libeditnerf/scene/scene_json.h"
#include "tests/catch.h"
#include "tests/editing/editable_fixture.h"

using namespace editnerf;

TEST_CASE("the page is told the scene's sparse points, and an empty list where there are none") {
  EditableScene scene = *FixtureEditableScene();
  CHECK(SceneToPageJson(scene, "fixture").at("points") == Json::array());
  scene.scene.points = torch::tensor({0.25F, -1.0F, 3.0F}).view({1, 3});
  CHECK(SceneToPageJson(scene, "fixture").at("points") == Json::parse("[[0.25, -1.0, 3.0]]"));
  scene.scene.points = torch::rand({2 * kMaxScenePoints, 3});
  CHECK(static_cast<int64_t>(SceneToPageJson(scene, "fixture").at("points").size()) == kMaxScenePoints);
}
