// The programs in processes of their own: what they say of bad input, and what an interrupt or a full disk leaves
// behind.
#include <fmt/format.h>
#include <signal.h>

#include <filesystem>
#include <functional>
#include <string>
#include <vector>

#include "libeditnerf/imaging/scene_folder.h"
#include "libeditnerf/poses/child_process.h"
#include "libeditnerf/scene/synthetic/synthetic_scene.h"
#include "libeditnerf/training/metrics_log.h"
#include "libeditnerf/training/run.h"
#include "tests/catch.h"
#include "tests/imaging/scratch_folder.h"

using namespace editnerf;

namespace {

namespace fs = std::filesystem;

struct Outcome {
  int code = -1;
  std::string text;  // standard output and standard error
};

// A scratch folder with a scene of four small images in it, and the programs of this build.
class Desk {
 public:
  Desk() {
    SyntheticOptions options;
    options.frames = 4;
    options.val_frames = 1;
    options.edit_frames = 0;
    options.width = 32;
    options.height = 18;
    options.samples_per_side = 1;
    WriteSceneFolder(MakeSyntheticScene("static", options), folder_ / "scene");
  }

  fs::path operator/(const std::string& name) const { return folder_ / name; }

  // `before`: shell commands, run in the program's process before it.
  Outcome Run(std::vector<std::string> arguments, const std::string& before = "",
              const std::function<void(const std::string& line)>& on_line = {}) const {
    arguments[0] = EDITNERF_BINARY_DIR "/apps/" + arguments[0];
    arguments.insert(arguments.begin(), {"/bin/sh", "-c", before + " exec \"$@\"", "sh"});
    ChildProcess child;
    child.arguments = arguments;
    child.log = folder_ / "log.txt";
    child.on_line = on_line;
    fs::remove(child.log);
    const int code = RunChild(child);
    return {code, ReadText(child.log)};
  }

  // enf-train up to this step, a row of metrics.csv for each.
  Outcome Train(int64_t steps, const std::vector<std::string>& more = {}, const std::string& before = "",
                const std::function<void(const std::string& line)>& on_line = {}) const {
    std::vector<std::string> arguments = {
        "enf-train", (folder_ / "scene").string(), "--out", (folder_ / "run").string(),          "--config", "tiny",
        "--set",     "train.log_every=1",          "--set", fmt::format("train.steps={}", steps)};
    arguments.insert(arguments.end(), more.begin(), more.end());
    return Run(arguments, before, on_line);
  }

 private:
  ScratchFolder folder_;
};

}  // namespace

TEST_CASE("an interrupted enf-train writes its checkpoint, and continues from there with its metrics") {
  const Desk desk;
  pid_t process = 0;
  bool interrupted = false;
  const Outcome stopped = desk.Train(20000, {}, "echo $$;", [&](const std::string& line) {
    if (process == 0) process = std::stoi(line);
    if (interrupted || line.rfind("training", 0) != 0) return;
    interrupted = true;
    ::kill(process, SIGINT);
  });
  INFO(stopped.text);
  REQUIRE(stopped.code == 130);
  const int64_t step = LoadRun(desk / "run").counters.step;
  CHECK_THAT(stopped.text,
             HasText(fmt::format("interrupted at step {}; the checkpoint is written, continue with --resume", step)));
  const std::string metrics = ReadText(desk / "run/metrics.csv");
  CHECK(ReadMetricsLog(desk / "run/metrics.csv").back().step == step);

  const Outcome resumed = desk.Train(step + 2, {"--resume"});
  INFO(resumed.text);
  CHECK(resumed.code == 0);
  CHECK(LoadRun(desk / "run").counters.step == step + 2);
  CHECK(ReadText(desk / "run/metrics.csv").rfind(metrics, 0) == 0);
  const std::vector<MetricsRow> rows = ReadMetricsLog(desk / "run/metrics.csv");
  REQUIRE(static_cast<int64_t>(rows.size()) == step + 2);
  CHECK(rows.back().step == step + 2);
}

TEST_CASE("a disk that fills up while training leaves the checkpoint from before, and is reported with the file") {
  const Desk desk;
  const fs::path checkpoint = desk / "run/checkpoint.safetensors";
  REQUIRE(desk.Train(2).code == 0);
  const std::string before = ReadText(checkpoint);
  // A limit of the file size stands in for a full disk: 32 KB, a fifth of the checkpoint.
  const Outcome full = desk.Train(4, {"--resume"}, "trap '' XFSZ; ulimit -f 64;");
  CHECK(full.code == 1);
  CHECK_THAT(full.text, HasText(checkpoint.string() + ": cannot be written: File too large"));
  CHECK(ReadText(checkpoint) == before);
  CHECK_FALSE(fs::exists(checkpoint.string() + ".partial"));
  CHECK(desk.Train(4, {"--resume"}).code == 0);
  CHECK(LoadRun(desk / "run").counters.step == 4);
}

TEST_CASE("the programs refuse a checkpoint that was cut off by its name") {
  const Desk desk;
  const fs::path checkpoint = desk / "run/checkpoint.safetensors";
  REQUIRE(desk.Train(1).code == 0);
  fs::resize_file(checkpoint, fs::file_size(checkpoint) / 2);
  const Outcome resumed = desk.Train(2, {"--resume"});
  CHECK(resumed.code == 1);
  CHECK_THAT(resumed.text, HasText("error: " + checkpoint.string() + ": "));
  const Outcome rendered =
      desk.Run({"enf-render", (desk / "run").string(), "--frames", "train", "--out", (desk / "pictures").string()});
  CHECK(rendered.code == 1);
  CHECK_THAT(rendered.text, HasText("error: " + checkpoint.string() + ": "));
  CHECK_FALSE(fs::exists(desk / "pictures"));
}

TEST_CASE("enf-replay prints what a skipped step was made of, and refuses a folder without one") {
  const Desk desk;
  REQUIRE(desk.Train(1).code == 0);
  const Outcome none = desk.Run({"enf-replay", (desk / "run").string()});
  CHECK(none.code == 1);
  CHECK_THAT(none.text, HasText((desk / "run").string() + ": no step of training lies here"));
  // A learning rate that no network survives.
  const Outcome bad = desk.Train(8, {"--set", "train.learning_rate=1e38", "--set", "train.final_learning_rate=1e38",
                                     "--set", "train.dump_bad_steps=true"});
  INFO(bad.text);
  CHECK_THAT(bad.text, HasText("skipped: not finite: "));
  REQUIRE(fs::exists(desk / "run/bad_steps/000001"));
  const Outcome replayed = desk.Run({"enf-replay", (desk / "run/bad_steps/000001").string()});
  INFO(replayed.text);
  CHECK(replayed.code == 0);
  CHECK_THAT(replayed.text, HasText("step 1\n") && HasText("loss reconstruction") && HasText("gradient of ") &&
                                HasText("not finite in the step: reconstruction"));
}

TEST_CASE("an unknown setting ends a program before it begins") {
  const Desk desk;
  const Outcome set = desk.Train(1, {"--set", "train.step=5"});
  CHECK(set.code == 2);
  CHECK_THAT(set.text, HasText("--set train.step=5: unknown key 'train.step'; did you mean 'steps'?"));
  const std::string file = (desk / "mine.yaml").string();
  WriteText(file, "train:\n  step: 5\n");
  const Outcome config =
      desk.Run({"enf-train", (desk / "scene").string(), "--out", (desk / "run").string(), "--config", file});
  CHECK(config.code == 2);
  CHECK_THAT(config.text, HasText(file + ":2: unknown key 'train.step'; did you mean 'steps'?"));
  CHECK_FALSE(fs::exists(desk / "run"));
}

TEST_CASE("a video that cannot be decoded is named, and no scene is made of it") {
  const Desk desk;
  const std::string video = (desk / "clip.mp4").string(), out = (desk / "out").string();
  WriteText(video, "this is not a video");
  for (const char* program : {"enf-solve-poses", "enf"}) {
    INFO(program);
    const Outcome outcome = desk.Run({program, video, "--out", out});
    CHECK(outcome.code == 1);
    CHECK_THAT(outcome.text, HasText("error: " + video + ": cannot be opened as a video"));
  }
  CHECK_FALSE(fs::exists(desk / "out/dataset.json"));
  CHECK_FALSE(fs::exists(desk / "out/scene/dataset.json"));
  CHECK_FALSE(fs::exists(desk / "out/stages.json"));
}
