#include "libeditnerf/pipeline/whole_way.h"

#include <algorithm>
#include <functional>
#include <nlohmann/json.hpp>

#include "libeditnerf/base/clock.h"
#include "libeditnerf/base/error.h"
#include "libeditnerf/base/file.h"
#include "libeditnerf/base/logging.h"
#include "libeditnerf/config/yaml.h"
#include "libeditnerf/imaging/json_file.h"
#include "libeditnerf/pipeline/run_report.h"
#include "libeditnerf/pipeline/stages.h"
#include "libeditnerf/poses/solve_poses.h"
#include "libeditnerf/tracking/detection_run.h"
#include "libeditnerf/tracking/flow_cache.h"
#include "libeditnerf/tracking/flow_choice.h"

namespace editnerf {
namespace {

namespace fs = std::filesystem;

// Shares of a time budget: pretraining finds where things are, training makes the picture. Of a short budget
// pretraining takes a quarter; of a long one less, as more helps detection little (docs/benchmarks, "Ten minutes").
constexpr double kPretrainShare = 0.25;
constexpr double kEnoughSeconds = 40, kEnoughShare = 0.07;
constexpr double kReportShare = 0.12;
constexpr double kFewestSeconds = 10;
constexpr double kLearnShare = 0.6;  // of the budget that is left for the rest, however long the poses take

// The stages that are done, with their seconds, in WORK/stages.json.
class StageBook {
 public:
  explicit StageBook(const fs::path& work) : path_(work / "stages.json") {
    if (fs::exists(path_)) book_ = ReadJson(path_);
    if (!book_.is_object()) Throw<DataError>("{}: expected an object; remove it to begin again", path_.string());
    for (const auto& [stage, seconds] : book_.items()) {
      if (seconds.is_number()) continue;
      Throw<DataError>("{}: '{}': expected seconds, found {}; remove the entry to repeat the stage", path_.string(),
                       stage, seconds.dump());
    }
  }

  // Runs `body` unless the stage is in the book.
  void Do(const std::string& name, const std::function<void()>& body) {
    if (book_.contains(name)) {
      LogInfo("{}: done before, skipped", name);
      return;
    }
    LogInfo("{}", name);
    const Stopwatch clock;
    body();
    book_[name] = clock.Seconds();
    WriteJson(path_, book_);
  }

 private:
  fs::path path_;
  nlohmann::ordered_json book_ = nlohmann::ordered_json::object();
};

double PretrainSeconds(double left) {
  return std::max(kFewestSeconds, std::min(kPretrainShare * left, kEnoughSeconds + kEnoughShare * left));
}

bool IsSceneFolder(const fs::path& input) {
  return fs::exists(input / "scene.json") && fs::exists(input / "dataset.json");
}

// Links to everything of a given scene folder but what detection writes: the user's own folder is never changed.
void LinkScene(const fs::path& input, const fs::path& scene) {
  MakeFolder(scene);
  for (const fs::directory_entry& entry : fs::directory_iterator(input)) {
    const std::string name = entry.path().filename().string();
    if (name == "depth" || name == "flow" || name == "data") continue;
    const fs::path link = scene / name;
    if (fs::is_symlink(link)) fs::remove(link);
    fs::create_symlink(fs::absolute(entry.path()), link);
  }
}

void CheckConfig(const WholeWayRequest& request) {
  Config comparable = request.config;
  const fs::path path = request.work / "config.yaml";
  if (fs::exists(path)) {
    Config before = LoadConfig(path);
    // How long to train may change between calls.
    before.pretrain.seconds = comparable.pretrain.seconds;
    before.train.seconds = comparable.train.seconds;
    before.pretrain.steps = comparable.pretrain.steps;
    before.train.steps = comparable.train.steps;
    if (ToYaml(before) != ToYaml(comparable)) {
      Throw<ConfigError>(
          "{}: this folder was begun with another configuration (config.yaml in it); give another --out, "
          "or remove it",
          request.work.string());
    }
  }
  WriteFileAtomically(path, ToYaml(request.config));
}

}  // namespace

void RunWholeWay(const WholeWayRequest& request) {
  const Stopwatch clock;
  const fs::path &work = request.work, scene_folder = work / "scene";
  if (!fs::exists(request.input)) {
    Throw<DataError>("{}: no such file or folder; expected a video, a folder of images or a scene folder",
                     request.input.string());
  }
  CheckTraining(request.config);
  MakeFolder(work);
  CheckConfig(request);
  StageBook book(work);
  Config config = request.config;
  double budget = request.time_budget;
  const auto left = [&] { return std::max(kFewestSeconds, budget - clock.Seconds()); };

  book.Do("scene", [&] {
    if (IsSceneFolder(request.input)) return LinkScene(request.input, scene_folder);
    SolvePosesOptions options;
    options.max_frames = request.max_frames;
    options.force = true;
    options.colmap.threads = request.threads;
    options.colmap.seed = request.seed;
    SolvePoses(request.input, scene_folder, options);
    const double least = clock.Seconds() + kLearnShare * budget;
    if (budget > 0 && budget < least) {
      LogWarning("the poses took {:.0f} s of a budget of {:.0f} s; going on for {:.0f} s more", clock.Seconds(), budget,
                 kLearnShare * budget);
      budget = least;
    }
  });
  const Scene scene = OpenScene(scene_folder, config.data);
  LogInfo("{} training frames of {} x {} pixels, {} held out", scene.train.size(), scene.width(), scene.height(),
          scene.val.size());

  StageRequest stage;
  stage.scene_folder = scene_folder;
  stage.device = request.device;
  stage.resume = true;
  stage.out = work / "pretrained";
  book.Do("pretrain", [&] {
    if (request.time_budget > 0) config.pretrain.seconds = PretrainSeconds(left());
    stage.config = config;
    RunPretraining(scene, stage);
  });
  book.Do("detect", [&] {
    const PretrainedMaps maps = ReadPretrainedMaps(work / "pretrained", scene);
    WriteDetection(
        scene,
        RunDetection(scene, maps, config.detect, *MakeOpticalFlow(config.flow), FlowCachePath(work / "pretrained")),
        scene_folder);
  });
  stage.out = work / "run";
  stage.pretrained = work / "pretrained";
  book.Do("train", [&] {
    if (request.time_budget > 0) config.train.seconds = std::max(kFewestSeconds, (1 - kReportShare) * left());
    stage.config = config;
    RunTraining(scene, stage, scene_folder);
  });
  book.Do("report", [&] { WriteRunReport(work, scene, request.device, request.command); });
  LogInfo("open {}", (work / "report" / "index.html").string());
}

}  // namespace editnerf
