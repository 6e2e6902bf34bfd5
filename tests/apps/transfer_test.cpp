// enf-transfer in a process of its own.
#include <filesystem>
#include <string>
#include <vector>

#include "libeditnerf/editing/edit_file.h"
#include "libeditnerf/poses/child_process.h"
#include "tests/catch.h"
#include "tests/editing/editable_fixture.h"
#include "tests/editing/moving_patch.h"
#include "tests/imaging/scratch_folder.h"

using namespace editnerf;

TEST_CASE("enf-transfer writes an edit and its video, and says what is wrong with its input") {
  const ScratchFolder folder;
  SaveRun(FixtureRun(), folder / "run");
  WriteMovingPatch(folder / "clip.mp4", 6);
  std::string said;
  const auto run = [&](const std::vector<std::string>& more) {
    ChildProcess child;
    child.arguments = {EDITNERF_BINARY_DIR "/apps/enf-transfer",
                       (folder / "run").string(),
                       "--video",
                       (folder / "clip.mp4").string(),
                       "--out",
                       (folder / "edit.json").string()};
    child.arguments.insert(child.arguments.end(), more.begin(), more.end());
    child.log = folder / "log.txt";
    std::filesystem::remove(child.log);
    const int code = RunChild(child);
    said = ReadText(child.log);
    return code;
  };
  const std::string preview = (folder / "preview.mp4").string();
  const int code = run({"--point", "40,40", "--key-point", "0", "--preview", preview});
  INFO(said);
  REQUIRE(code == 0);
  const EditFile edit = ReadEditFile(folder / "edit.json");
  REQUIRE(edit.frames.size() == 6);
  CHECK(edit.fps == Approx(12));
  // The key point's range along x is -0.1 to 0.1, and the disc goes to the right as it does.
  CHECK(edit.frames.front().key_points[0]->x == Approx(-0.1).margin(0.005));
  CHECK(edit.frames.back().key_points[0]->x == Approx(0.1).margin(0.005));
  CHECK(std::filesystem::file_size(preview) > 0);

  REQUIRE(run({"--point", "40,40", "--key-point", "0", "--pair", "0:frame4", "--pair", "5:frame2"}) == 0);
  CHECK(ReadEditFile(folder / "edit.json").frames.back().key_points[0]->x == Approx(0).margin(0.005));

  CHECK(run({"--point", "400,40", "--key-point", "0"}) == 1);
  CHECK_THAT(said, HasText("clip.mp4: the point 400,40 is not in the picture, which has 128 x 96 pixels"));
  CHECK(run({"--point", "40,40", "--key-point", "2"}) == 1);
  CHECK_THAT(said, HasText("key point 2: the run has 2, numbered from 0"));
  CHECK(run({"--point", "40", "--key-point", "0"}) == 2);
  CHECK_THAT(said, HasText("--point: expected X,Y in pixels such as 160,90, found '40'"));
  CHECK(run({"--point", "40,40", "--key-point", "0", "--pair", "0:nine"}) == 1);
  CHECK_THAT(said, HasText("--pair 0:nine: the run has no training frame 'nine'"));
  CHECK(run({"--point", "120,10", "--key-point", "0"}) == 1);
  CHECK_THAT(said, HasText("choose one that moves"));
  std::filesystem::remove(folder / "clip.mp4");
  CHECK(run({"--point", "40,40", "--key-point", "0"}) == 1);
  CHECK_THAT(said, HasText("clip.mp4: no such file"));
}
