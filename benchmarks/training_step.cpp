// What one training step costs: trains a synthetic scene for a while, then measures steps of the same state with each
// way of evaluating the fast field, in processor time, so that other load on the machine matters less; beside them one
// picture of 320 x 180 and one update of the occupancy grids.
//
//   bench-training-step SCENE STAGE STEPS [THREADS]     e.g. cups train 400 2; STAGE: pretrain or train
#include <sys/resource.h>

#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <string>

#include "libeditnerf/base/clock.h"
#include "libeditnerf/base/parallel.h"
#include "libeditnerf/config/yaml.h"
#include "libeditnerf/render/image_renderer.h"
#include "libeditnerf/scene/synthetic/synthetic_scene.h"
#include "libeditnerf/training/trainer.h"

using namespace editnerf;

namespace {

double ProcessorSeconds() {
  rusage usage;
  getrusage(RUSAGE_SELF, &usage);
  return static_cast<double>(usage.ru_utime.tv_sec + usage.ru_stime.tv_sec) +
         1e-6 * static_cast<double>(usage.ru_utime.tv_usec + usage.ru_stime.tv_usec);
}

// A few points on the true paths of the scene's parts, as tracks [T, N, 3].
torch::Tensor Tracks(const Scene& scene) {
  std::vector<torch::Tensor> frames;
  for (const int64_t frame : scene.train) {
    frames.push_back(scene.truth->scene_from_object[frame].slice(1, 0, 3).select(2, 3).to(torch::kFloat32));
  }
  return torch::stack(frames);
}

void Measure(Run run, const Scene& scene, const char* kernel, int64_t steps) {
  const std::filesystem::path scratch = std::filesystem::temp_directory_path() / "editnerf_bench";
  Trainer trainer(std::move(run), scene, std::nullopt, scratch);
  trainer.Step();
  const int64_t samples = trainer.run().counters.samples, rays = trainer.run().counters.rays;
  const double processor = ProcessorSeconds();
  Stopwatch watch;
  for (int64_t i = 0; i < steps; ++i) trainer.Step();
  const double seconds = watch.Seconds(), used = ProcessorSeconds() - processor;
  const auto count = static_cast<double>(trainer.run().counters.samples - samples);
  std::printf("%-8s %6.2f samples per ray, %8.1f ns of processor per sample, %6.3f M samples/s by the clock\n", kernel,
              count / static_cast<double>(trainer.run().counters.rays - rays), 1e9 * used / count,
              1e-6 * count / seconds);

  const torch::NoGradGuard no_grad;
  const Run& trained = trainer.run();
  const FrameStates states = trained.field->States(torch::arange(static_cast<int64_t>(scene.train.size())));
  const double before_update = ProcessorSeconds();
  trained.renderer->UpdateOccupancy(*trained.field, states);
  const double update = ProcessorSeconds() - before_update;
  const double step = used / static_cast<double>(steps);
  std::printf("%-8s occupancy update %.1f ms of processor, %.1f %% of a step's when every 16th has one\n", kernel,
              1e3 * update, 100 * update / 16 / step);
  Camera camera = scene.frames[static_cast<size_t>(scene.train[0])].camera.Resized(320, 180);
  const FrameStates one = trained.field->States(torch::zeros({1}, torch::kInt64));
  const double before_picture = ProcessorSeconds();
  Stopwatch picture;
  constexpr int kPictures = 4;
  for (int i = 0; i < kPictures; ++i) RenderImage(*trained.field, *trained.renderer, camera, one);
  std::printf("%-8s picture of 320 x 180: %.0f ms of processor, %.0f ms by the clock\n", kernel,
              1e3 * (ProcessorSeconds() - before_picture) / kPictures, 1e3 * picture.Seconds() / kPictures);
}

}  // namespace

int main(int argc, char** argv) {
  if (argc < 4) {
    std::fprintf(stderr, "bench-training-step SCENE pretrain|train STEPS [THREADS]\n");
    return 2;
  }
  SetNumThreads(argc > 4 ? std::atoi(argv[4]) : 0);
  torch::manual_seed(1);
  SyntheticOptions options;
  options.frames = 40;
  options.edit_frames = 0;
  options.width = 160;
  options.height = 90;
  options.samples_per_side = 1;
  const Scene scene = MakeSyntheticScene(argv[1], options);
  Config config = LoadConfig("configs/fast.yaml");
  if (argc > 5)
    config.field.fast.canonical_hash.log2_table_size = config.field.fast.local_hash.log2_table_size =
        std::atoi(argv[5]);
  config.field.fast.kernel = "auto";
  const FieldStage stage = std::string(argv[2]) == "pretrain" ? FieldStage::kPretrain : FieldStage::kTrain;
  Run run = MakeRun(config, stage, scene, stage == FieldStage::kTrain ? Tracks(scene) : torch::Tensor(), torch::kCPU);
  run.scene_path = argv[1];
  const int64_t warm = std::atoll(argv[3]);
  {
    Trainer trainer(run, scene, std::nullopt, std::filesystem::temp_directory_path() / "editnerf_bench");
    for (int64_t i = 0; i < warm; ++i) trainer.Step();
    run.counters = trainer.run().counters;
  }
  for (const char* kernel : {"auto", "modules", "auto", "modules"}) {
    config.field.fast.kernel = kernel;
    Run other =
        MakeRun(config, stage, scene, stage == FieldStage::kTrain ? Tracks(scene) : torch::Tensor(), torch::kCPU);
    const torch::NoGradGuard no_grad;
    for (const auto& item : other.field->named_parameters())
      item.value().copy_(run.field->named_parameters()[item.key()]);
    for (const auto& item : other.renderer->named_buffers())
      item.value().copy_(run.renderer->named_buffers()[item.key()]);
    other.counters = run.counters;
    const torch::AutoGradMode gradients(true);
    Measure(other, scene, kernel, kernel == std::string("modules") ? 8 : 64);
  }
  return 0;
}
