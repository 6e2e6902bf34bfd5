// What tests/browser opens in the editor: two cups, trained on for as long as it takes until they can be told apart.
#include <torch/types.h>
#include <torch/utils.h>

#include <cstdlib>
#include <filesystem>
#include <optional>
#include <vector>

#include "tests/catch.h"
#include "tests/editing/moving_patch.h"
#include "tests/training/small_training.h"

using namespace editnerf;

namespace {

// A point of each cup's rim, where it is in the first frame.
const std::vector<std::vector<double>> kRims = {{-0.205, 0.007, -0.059, 1}, {0.046, 0.091, -0.035, 1}};

// [T, 2, 3]: where the cups' motion takes them.
torch::Tensor TracksOfRims(const Scene& scene) {
  const torch::Tensor motions = scene.truth->scene_from_object;
  std::vector<torch::Tensor> tracks;
  for (const int64_t frame : scene.train) {
    std::vector<torch::Tensor> at;
    for (size_t cup = 0; cup < kRims.size(); ++cup) {
      const auto of = static_cast<int64_t>(cup);
      const torch::Tensor moved = torch::matmul(motions[frame][of], torch::linalg_inv(motions[scene.train[0]][of]));
      at.push_back(torch::mv(moved, torch::tensor(kRims[cup], torch::kFloat64)).slice(0, 0, 3));
    }
    tracks.push_back(torch::stack(at));
  }
  return torch::stack(tracks).to(torch::kFloat32);
}

}  // namespace

// Hidden: run by name, with the folder in the environment, before tests/browser.
TEST_CASE("a run for the browser", "[.][browser-run]") {
  const char* const folder = std::getenv("EDITNERF_BROWSER_RUN");
  REQUIRE(folder != nullptr);
  torch::manual_seed(3);
  const Scene scene = SmallScene("cups", 40, 96);
  Config config = SmallFast();
  config.train.steps = 400;
  config.train.rays_per_step = 1024;
  // A few hundred steps settle best under a rate that falls; and the page is asked to change one part at a time, where
  // shadows would reach the others.
  config.train.final_learning_rate = 1e-3;
  config.train.average_weights = config.field.fast.shade = false;
  Trainer trainer(MakeRun(config, FieldStage::kTrain, scene, TracksOfRims(scene), torch::kCPU), scene, std::nullopt,
                  folder);
  for (int64_t step = 0; step < config.train.steps; ++step) trainer.Step();
  SaveRun(trainer.run(), folder);
  WriteMovingPatch(std::filesystem::path(folder) / "clip.mp4", 8);
}
