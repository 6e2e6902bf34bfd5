#include "libeditnerf/pipeline/stage_memory.h"

#include <torch/types.h>
#include <torch/utils.h>

#include <functional>
#include <map>
#include <utility>

#include "libeditnerf/imaging/key_point_files.h"
#include "libeditnerf/tracking/detection_run.h"
#include "tests/catch.h"
#include "tests/imaging/scratch_folder.h"
#include "tests/pipeline/peak_memory.h"
#include "tests/training/small_training.h"

using namespace editnerf;

namespace {

constexpr int64_t kMiB = int64_t{1} << 20;

// The tiny scene with images as large as they have to be for data to outweigh everything else.
Scene LargeScene(int64_t frames, int64_t width, int64_t height) {
  Scene scene = SmallScene("hinge", frames, 64);
  scene.truth.reset();
  for (SceneFrame& frame : scene.frames) frame.camera = frame.camera.Resized(width, height);
  const auto index = [](int64_t from, int64_t to) {
    return (torch::arange(to, torch::kInt64) * from).div(to, "floor");
  };
  scene.images = scene.images.index_select(1, index(scene.height(), height))
                     .index_select(2, index(scene.width(), width))
                     .contiguous();
  return scene;
}

// A few steps of a small field, and surfaces of few samples.
Config FewSteps() {
  Config config = SmallFast();
  config.render.march_steps = 8;
  config.pretrain.steps = config.train.steps = 3;
  config.train.trial_steps = config.pretrain.trial_steps = 0;
  return config;
}

StageRequest Request(const Config& config, const fs::path& out) {
  StageRequest request;
  request.config = config;
  request.scene_folder = request.out = out;
  return request;
}

// What detection leaves: a key point that moves, maps of all frames, and a place in every 36th pixel.
void WriteDetected(const Scene& scene, const fs::path& folder) {
  const auto frames = static_cast<int64_t>(scene.train.size()), places = scene.height() * scene.width() / 36;
  const torch::Tensor tracks = torch::linspace(0, 0.1, frames).view({-1, 1, 1}).expand({frames, 1, 3});
  const LocalCoordinates local = ToLocalCoordinates(tracks);
  WriteKeyPointFiles(folder, {local.local, local.scale, local.offset});
  for (const int64_t frame : scene.train) {
    const std::string& id = scene.frames[static_cast<size_t>(frame)].id;
    WriteMedianDepth(folder, id, torch::ones({scene.height(), scene.width()}));
    WriteFlow(folder, id, torch::zeros({scene.height(), scene.width(), 2}));
  }
  DepthTargets still;
  const int64_t count = frames * places;
  still.frame = torch::arange(frames, torch::kInt64).repeat_interleave(places);
  still.pixel = torch::zeros({count, 2}, torch::kInt64);
  still.distance = torch::ones({count});
  still.tolerance = torch::full({count}, 0.1F);
  still.key_point = torch::full({count}, kStandsStill, torch::kInt64);
  WriteDepthTargets(StillDepthPath(folder), still);
}

DetectedKeyPoints TracksAlone(const Scene& scene) {
  DetectedKeyPoints detected;
  detected.tracks = torch::zeros({static_cast<int64_t>(scene.train.size()), 1, 3});
  return detected;
}

std::map<std::string, int64_t> PartsOf(const StageMemory& memory, const std::string& phase) {
  for (const MemoryPhase& each : memory.phases) {
    if (each.name == phase) return {each.plan.parts.begin(), each.plan.parts.end()};
  }
  FAIL("no phase " << phase);
  return {};
}

std::vector<std::string> LinesOf(const std::function<void()>& stage) {
  std::vector<std::string> lines;
  const LogLevel level = GetLogLevel();
  SetLogLevel(LogLevel::kInfo);
  SetLogSink([&](LogLevel, const std::string& line) { lines.push_back(line); });
  stage();
  SetLogSink({});
  SetLogLevel(level);
  return lines;
}

// Runs a stage on `scene` and compares what it took with what it said. All of the scene counts as taken by the stage.
void CheckPlan(const StageMemory& memory, const Scene& scene, const std::function<void()>& stage) {
  if (!PeakMemory::Measurable()) {
    WARN("skipped: this system or build does not measure peaks of memory");
    return;
  }
  const CaughtLog quiet;
  const PeakMemory peak;
  stage();
  const auto taken = static_cast<double>(peak.Growth() + PlanScene(scene).Total());
  const auto planned = static_cast<double>(memory.Largest().plan.Total());
  INFO("planned " << planned / kMiB << " MiB, for " << memory.Largest().name << "; taken " << taken / kMiB << " MiB");
  CHECK(taken < 1.2 * planned + 32 * kMiB);
  CHECK(taken > 0.5 * planned);
}

}  // namespace

TEST_CASE("a stage's plan of memory has its phases in the order of time, with what each holds") {
  const Scene& scene = TinyScene();
  const int64_t frame = scene.height() * scene.width();
  const StageMemory pretraining = PlanPretraining(SmallFast(), scene, torch::kCPU);
  REQUIRE(pretraining.phases.size() == 4);
  CHECK(PartsOf(pretraining, "optical flow")["flow"] == 7 * 18 * frame);
  CHECK(PartsOf(pretraining, "static depth")["grey images"] == 8 * 4 * frame);
  CHECK(PartsOf(pretraining, "surface maps")["maps"] == 8 * (4 + 4 * 3) * frame);
  for (const MemoryPhase& phase : pretraining.phases) {
    INFO(phase.name);
    CHECK(phase.plan.Total() <= pretraining.Largest().plan.Total());
    CHECK(PartsOf(pretraining, phase.name)["ground truth"] == 10 * 5 * frame);
  }
  Config colours_alone = SmallFast();
  colours_alone.pretrain.lambda_depth = 0;
  CHECK(PlanPretraining(colours_alone, scene, torch::kCPU).phases.front().name == "optimisation");

  const ScratchFolder scratch;
  DetectedKeyPoints detected = TracksAlone(scene);
  CHECK(PlanTraining(SmallFast(), scene, torch::kCPU, detected, scratch.path()).phases.size() == 1);
  WriteDetected(scene, scratch.path());
  const StageMemory training = PlanTraining(SmallFast(), scene, torch::kCPU, detected, scratch.path());
  REQUIRE(training.phases.size() == 2);
  CHECK(PartsOf(training, "reading key points")["flow"] == 7 * 16 * frame);
  CHECK(PartsOf(training, "optimisation")["flow"] == 7 * 8 * frame);
  // The same once it is read, but for the header of a file.
  detected = ReadDetectedKeyPoints(scene, scratch.path());
  const StageMemory read = PlanTraining(SmallFast(), scene, torch::kCPU, detected);
  REQUIRE(read.phases.size() == 1);
  CHECK(std::abs(read.Largest().plan.Total() - training.phases.back().plan.Total()) < 10'000);
}

TEST_CASE("components that are left to auto count in a plan of memory, and making one draws no random numbers") {
  Config open = SmallFast();
  open.field.use_appearance = Choice::kAuto;
  Config without = open;
  without.field.use_appearance = Choice::kOff;
  const auto field = [](const Config& config) {
    return PartsOf(PlanPretraining(config, TinyScene(), torch::kCPU), "optimisation")["field"];
  };
  torch::manual_seed(3);
  const torch::Tensor expected = torch::rand({4});
  torch::manual_seed(3);
  CHECK(field(open) > field(without));
  CHECK(torch::equal(torch::rand({4}), expected));
}

TEST_CASE("the largest phase of a plan of memory is named first") {
  StageMemory memory;
  memory.phases = {{"optical flow", {{{"images", 20 * kMiB}, {"flow", 300 * kMiB}}}},
                   {"optimisation", {{{"field", 3 * kMiB}}}}};
  const std::vector<std::string> lines = ToText(memory);
  REQUIRE(lines.size() == 3);
  CHECK(lines[0] == "memory: at most 320 MiB beside LibTorch, for optical flow");
  CHECK(lines[1] == "memory for optical flow: 320 MiB: images 20, flow 300");
  CHECK(lines[2] == "memory for optimisation: 3.0 MiB: field 3.0");
}

TEST_CASE("the plan of memory is the first that a stage says") {
  const ScratchFolder scratch;
  const Scene scene = LargeScene(8, 64, 36);
  WriteDetected(scene, scratch.path());
  const Config config = FewSteps();
  const auto pretraining = LinesOf([&] { RunPretraining(scene, Request(config, scratch / "pretrained")); });
  const auto training = LinesOf([&] { RunTraining(scene, Request(config, scratch / "run"), scratch.path()); });
  for (const auto& [lines, first_phase] : {std::pair(pretraining, "optical flow"), {training, "reading key points"}}) {
    REQUIRE(lines.size() > 3);
    CHECK_THAT(lines[0], HasText("memory: at most"));
    CHECK_THAT(lines[1], HasText(std::string("memory for ") + first_phase));
  }
}

TEST_CASE("pretraining takes the memory that it plans") {
  const ScratchFolder scratch;
  const Scene scene = LargeScene(40, 480, 270);
  const StageRequest request = Request(FewSteps(), scratch / "pretrained");
  CheckPlan(PlanPretraining(request.config, scene, torch::kCPU), scene, [&] { RunPretraining(scene, request); });
}

TEST_CASE("training takes the memory that it plans") {
  const ScratchFolder scratch;
  const Scene scene = LargeScene(20, 960, 540);
  WriteDetected(scene, scratch.path());
  const StageRequest request = Request(FewSteps(), scratch / "run");
  CheckPlan(PlanTraining(request.config, scene, torch::kCPU, TracksAlone(scene), scratch.path()), scene,
            [&] { RunTraining(scene, request, scratch.path()); });
}
