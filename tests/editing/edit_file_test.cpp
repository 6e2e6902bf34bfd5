#include "libeditnerf/editing/edit_file.h"

#include <algorithm>
#include <string>
#include <utility>
#include <vector>

#include "libeditnerf/base/error.h"
#include "libeditnerf/base/file.h"
#include "tests/catch.h"

using namespace editnerf;

namespace {

// The example of the documentation, so that it stays true.
std::string Example() {
  const std::string page = ReadFile(std::string(EDITNERF_SOURCE_DIR) + "/docs/edit-files.md");
  const size_t begin = page.find("```json") + 7;
  return page.substr(begin, page.find("```", begin) - begin);
}

bool SamePoints(const EditFrame& a, const EditFrame& b) {
  return std::equal(
      a.key_points.begin(), a.key_points.end(), b.key_points.begin(), b.key_points.end(),
      [](const auto& p, const auto& q) { return p.has_value() == q.has_value() && (!p || Norm(*p - *q) == 0); });
}

}  // namespace

TEST_CASE("the documented edit file is read as documented") {
  const EditFile edit = ParseEditFile(Example(), "edit.json");
  CHECK(edit.fps == 24);
  CHECK(edit.width == 320);
  CHECK(edit.height == 180);
  REQUIRE(edit.frames.size() == 4);
  CHECK(edit.frames[0].key_points.empty());
  CHECK(edit.frames[0].code_frame == "000012");
  CHECK(edit.frames[1].camera_frame == "000012");  // from the frame before
  CHECK(edit.frames[1].code_frame.empty());
  CHECK(edit.frames[1].key_points[0]->z == 0.40);
  CHECK_FALSE(edit.frames[2].key_points[0].has_value());
  CHECK(edit.frames[2].key_points[1]->x == 0.31);
  REQUIRE(edit.frames[3].camera.has_value());
  CHECK(edit.frames[3].camera_frame.empty());
  CHECK(edit.frames[3].camera->position.z == -2);
  CHECK(edit.frames[3].camera->focal_length == 350);
}

TEST_CASE("edit files survive being written and read again") {
  EditFile edit = ParseEditFile(Example(), "edit.json");
  edit.fps = 29.97;
  edit.frames[1].key_points[0]->x = 0.1 + 0.2;
  edit.frames.push_back(edit.frames[3]);
  const std::string text = WriteEditFile(edit);
  const EditFile again = ParseEditFile(text, "again.json");
  CHECK(again.fps == edit.fps);
  CHECK(again.width == edit.width);
  REQUIRE(again.frames.size() == edit.frames.size());
  for (size_t i = 0; i < edit.frames.size(); ++i) {
    CHECK(SamePoints(again.frames[i], edit.frames[i]));
    CHECK(again.frames[i].camera_frame == edit.frames[i].camera_frame);
    CHECK(again.frames[i].code_frame == edit.frames[i].code_frame);
    CHECK(again.frames[i].camera.has_value() == edit.frames[i].camera.has_value());
  }
  CHECK(again.frames[4].camera->principal_point == edit.frames[3].camera->principal_point);
  CHECK(WriteEditFile(again) == text);
}

TEST_CASE("mistakes in edit files are named with their place") {
  const std::vector<std::pair<std::string, std::string>> mistakes = {
      {R"([1])", "e.json: expected an object, found [1]"},
      {R"({"frames": []})", "e.json: frames: expected a list of at least one frame, found []"},
      {R"({"frame": []})", "e.json: unknown key 'frame'; expected one of: fps, size, frames"},
      {R"({"fps": 24})", "e.json: 'frames' is missing"},
      {R"({"fps": 0, "frames": [1]})", "e.json: fps: expected a rate above 0 and up to 1000, found 0"},
      {R"({"size": [32.5, 18], "frames": [1]})",
       "e.json: size: expected whole numbers from 1 to 65536, found 32.5 x 18"},
      {R"({"frames": [{"code_frame": "a"}]})",
       "e.json: frames[0]: 'camera' is missing; give a camera or the id of a scene frame in the first frame"},
      {R"({"frames": [{"camera": "a"}]})",
       "e.json: frames[0]: names neither a key point position nor a code_frame; give at least one"},
      {R"({"frames": [{"camera": "a", "key_points": [null, null]}]})",
       "e.json: frames[0]: names neither a key point position nor a code_frame; give at least one"},
      {R"({"frames": [{"camera": "a", "key_points": [[0, 0, 0], [1, 2]]}]})",
       "e.json: frames[0].key_points[1]: expected 3 numbers in scene units, or null, found [1,2]"},
      {R"({"frames": [{"camera": "a", "key_points": [[0, 0, "x"]]}]})",
       "e.json: frames[0].key_points[0]: expected 3 numbers in scene units, or null, found [0,0,\"x\"]"},
      {R"({"frames": [{"camera": 3, "code_frame": "a"}]})",
       "e.json: frames[0].camera: expected the id of a frame in quotes, found 3"},
      {R"({"frames": [{"camera": "a", "code_frame": "a"}, {"code_frame": ""}]})",
       "e.json: frames[1].code_frame: expected the id of a frame in quotes, found \"\""},
      {R"({"frames": [{"camera": {}, "code_frame": "a"}]})", "e.json: frames[0].camera: 'orientation' is missing"},
  };
  for (const auto& [text, message] : mistakes) CHECK_THROWS_WITH(ParseEditFile(text, "e.json"), message);
  CHECK_THROWS_AS(ParseEditFile("{", "e.json"), DataError);
  CHECK_THROWS_AS(WriteEditFile({}), DataError);
}
