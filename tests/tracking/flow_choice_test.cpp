#include "libeditnerf/tracking/flow_choice.h"

#include <atomic>
#include <filesystem>

#include "libeditnerf/base/error.h"
#include "libeditnerf/base/safetensors.h"
#include "libeditnerf/config/validate.h"
#include "libeditnerf/tracking/detection_run.h"
#include "libeditnerf/tracking/flow_cache.h"
#include "made_up_raft.h"
#include "moving_spheres.h"
#include "tests/catch.h"
#include "tests/imaging/scratch_folder.h"
#include "tests/training/small_training.h"

using namespace editnerf;

namespace {

// Answers with its number and counts how often it is asked.
class CountingFlow : public OpticalFlow {
 public:
  explicit CountingFlow(float value, bool gains = false) : value_(value), gains_(gains) {}
  std::string Name() const override { return "constant " + std::to_string(value_); }
  bool GainsFromGuess() const override { return gains_; }
  torch::Tensor Flow(const torch::Tensor& from, const torch::Tensor&) const override {
    ++asked;
    return torch::full({from.size(0), from.size(1), 2}, value_);
  }
  mutable std::atomic<int> asked{0};

 private:
  float value_;
  bool gains_;
};

torch::Tensor SomeImages() {
  torch::manual_seed(2);
  return torch::randint(0, 255, {4, 24, 32, 3}, torch::kUInt8);
}

}  // namespace

TEST_CASE("the configuration chooses the flow: RAFT where weights are given, DIS otherwise") {
  const ScratchFolder folder;
  const std::string weights = (folder / "raft.safetensors").string();
  WriteSafetensors(weights, testing::MadeUpRaftWeights("small"));
  FlowConfig config;
  CHECK(MakeOpticalFlow(config)->Name() == "DIS");
  CHECK(MakeOpticalFlow(config)->GainsFromGuess());
  config.weights = weights;
  CHECK(MakeOpticalFlow(config)->Name() == "DIS from RAFT (small), 12 iterations, images enlarged 2 times");
  CHECK_FALSE(MakeOpticalFlow(config)->GainsFromGuess());
  config.refine = false;
  config.enlarge = 1;
  config.iterations = 7;
  CHECK(MakeOpticalFlow(config)->Name() == "RAFT (small), 7 iterations");
  config.method = "dis";
  CHECK(MakeOpticalFlow(config)->Name() == "DIS");
  config.method = "raft";
  config.weights = (folder / "none.pth").string();
  CHECK_THROWS_WITH(MakeOpticalFlow(config), HasText("none.pth: no such file"));
  config.weights.clear();
  CHECK_THROWS_AS(MakeOpticalFlow(config), ConfigError);
  Config whole;
  whole.flow = config;
  CHECK_THROWS_WITH(ValidateConfig(whole, "a.yaml"), "a.yaml: flow.method is raft, which takes a file in flow.weights");
}

TEST_CASE("other weights are another flow by the same name") {
  const ScratchFolder folder;
  FlowConfig config;
  config.weights = (folder / "raft.safetensors").string();
  auto tensors = testing::MadeUpRaftWeights("small");
  WriteSafetensors(config.weights, tensors);
  const auto first = MakeOpticalFlow(config), same = MakeOpticalFlow(config);
  tensors["feature_encoder.conv.bias"][5] += 1;
  WriteSafetensors(config.weights, tensors);
  const auto other = MakeOpticalFlow(config);
  CHECK(first->Identity() == same->Identity());
  CHECK(first->Identity() != other->Identity());
  CHECK(first->Name() == other->Name());
}

TEST_CASE("kept flow is read for the same images and flow alone, and a damaged file is replaced") {
  const ScratchFolder folder;
  const auto path = folder / "run/optical_flow.safetensors";
  const torch::Tensor images = SomeImages();
  const CountingFlow flow(0.5F);
  const FlowSequence computed = CachedFlowSequence(images, flow, path, /*keep=*/false);
  CHECK_FALSE(std::filesystem::exists(path));
  CachedFlowSequence(images, flow, path);
  CHECK(flow.asked == 12);
  const FlowSequence kept = CachedFlowSequence(images, flow, path);
  CHECK(flow.asked == 12);
  CHECK(torch::equal(kept.forward, computed.forward));
  CHECK(torch::equal(kept.backward, computed.backward));
  CHECK(torch::equal(kept.forward_valid, computed.forward_valid));
  CHECK(torch::equal(kept.backward_valid, computed.backward_valid));

  const CountingFlow other(0.25F);
  CHECK(CachedFlowSequence(images, other, path, false).forward[0][0][0][0].item<float>() == 0.25F);
  torch::Tensor changed = images.clone();
  changed[2][3][4][1] = changed[2][3][4][1].item<int64_t>() ^ 1;
  CachedFlowSequence(changed, flow, path, false);
  CHECK(flow.asked == 18);

  std::filesystem::resize_file(path, std::filesystem::file_size(path) - 7);
  CachedFlowSequence(images, flow, path);
  CHECK(flow.asked == 24);
  CachedFlowSequence(images, flow, path);
  CHECK(flow.asked == 24);
}

TEST_CASE("kept flow of the wrong type or shape is named and computed again") {
  const ScratchFolder folder;
  const auto path = folder / "optical_flow.safetensors";
  const torch::Tensor images = SomeImages();
  const CountingFlow flow(0.5F);
  CachedFlowSequence(images, flow, path);
  const SafetensorsFile whole = ReadSafetensors(path);
  const auto complaint = [&](const torch::Tensor& forward) {
    SafetensorsFile changed = whole;
    changed.tensors.erase("forward");
    if (forward.defined()) changed.tensors["forward"] = forward;
    WriteSafetensors(path, changed.tensors, changed.metadata);
    const int before = flow.asked;
    const CaughtLog log;
    const FlowSequence read = CachedFlowSequence(images, flow, path);
    CHECK(flow.asked == before + 6);
    CHECK(torch::equal(read.forward, whole.tensors.at("forward")));
    return log.text();
  };
  const torch::Tensor forward = whole.tensors.at("forward");
  CHECK_THAT(complaint(forward.to(torch::kFloat64)),
             HasText(path.string() + ": kept flow: expected float32, found Double; optical flow is computed again"));
  CHECK_THAT(complaint(forward.slice(1, 1)),
             HasText(path.string() + ": kept flow: expected shape [3, 24, 32, 2], found [3, 23, 32, 2]"));
  CHECK_THAT(complaint({}), HasText(path.string() + ": kept flow: expected shape [3, 24, 32, 2]"));
}

TEST_CASE("detection says which flow it stands on, and reads kept flow unless a guess would make it better") {
  const ScratchFolder folder;
  const MovingSpheres clip = RenderMovingSpheres({Resting({0, 0, 0.2})}, {6, 64, 48});
  DetectionConfig config;
  config.volume_resolution = 24;
  config.min_observations = 3;
  const torch::Tensor images = clip.scene.images.index_select(0, torch::tensor(clip.scene.train, torch::kInt64));
  const CountingFlow flow(0.5F);
  CachedFlowSequence(images, flow, FlowCachePath(folder.path()));
  CHECK(flow.asked == 10);
  const DetectionRun run = RunDetection(clip.scene, clip.maps, config, flow, FlowCachePath(folder.path()));
  CHECK(run.detection.notes.front() == "optical flow: " + flow.Name());
  CHECK((run.flows.forward == 0.5F).all().item<bool>());
  const int after_cache = flow.asked;
  RunDetection(clip.scene, clip.maps, config, flow);
  CHECK(flow.asked >= after_cache + 10);
  const CountingFlow guided(0.5F, /*gains=*/true);
  RunDetection(clip.scene, clip.maps, config, guided, FlowCachePath(folder.path()));
  CHECK(guided.asked >= 10);
}

TEST_CASE("a sequence's flow is that of its pairs, however images are prepared") {
  const ScratchFolder folder;
  FlowConfig config;
  config.weights = (folder / "raft.safetensors").string();
  config.iterations = 2;
  config.enlarge = 1;
  WriteSafetensors(config.weights, testing::MadeUpRaftWeights("small"));
  const torch::Tensor images = SomeImages();
  for (const bool refine : {false, true}) {
    config.refine = refine;
    const auto flow = MakeOpticalFlow(config);
    const FlowSequence sequence = ComputeFlowSequence(images, *flow);
    CHECK((sequence.forward[1] - flow->Flow(images[1], images[2])).abs().max().item<double>() < 1e-3);
    CHECK((sequence.backward[2] - flow->Flow(images[3], images[2])).abs().max().item<double>() < 1e-3);
    const torch::Tensor guess = torch::full({24, 32, 2}, 1.5F);
    const FlowSequence guided = ComputeFlowSequence(images, *flow, [&](int64_t, int64_t) { return guess; });
    CHECK((guided.forward[0] - flow->FlowFrom(images[0], images[1], guess)).abs().max().item<double>() < 1e-3);
    CHECK((guided.forward[0] - sequence.forward[0]).abs().max().item<double>() > 1e-3);
  }
}
