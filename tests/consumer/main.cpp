// Uses the installed library as another project would: loads a run, moves a key point, renders an image.
//
//   consumer make RUN     writes a small untrained run to work on
//   consumer RUN IMAGE    the edit itself; IMAGE is a .ppm file
#include <torch/types.h>
#include <torch/utils.h>

#include <fstream>
#include <iostream>
#include <string>

#include "libeditnerf/base/error.h"
#include "libeditnerf/config/yaml.h"
#include "libeditnerf/render/image_renderer.h"
#include "libeditnerf/scene/synthetic/synthetic_scene.h"
#include "libeditnerf/training/run.h"

namespace {

void MakeSmallRun(const std::string& folder) {
  editnerf::SyntheticOptions options;
  options.frames = 4;
  options.val_frames = options.edit_frames = 0;
  options.width = 32;
  options.height = 18;
  const editnerf::Config config = editnerf::LoadConfigText(
      "field: {kind: fast, warp: {enabled: false}}\nrender: {sampler: occupancy, occupancy_resolution: 16}",
      "consumer.yaml");
  const torch::Tensor tracks = torch::linspace(0, 0.3, 4).view({4, 1, 1}).expand({4, 1, 3});
  editnerf::SaveRun(editnerf::MakeRun(config, editnerf::FieldStage::kTrain,
                                      editnerf::MakeSyntheticScene("hinge", options), tracks, torch::kCPU),
                    folder);
}

void RenderEdit(const std::string& folder, const std::string& path) {
  const editnerf::Run run = editnerf::LoadRun(folder);
  const torch::NoGradGuard no_grad;
  editnerf::FrameStates state = run.field->States(torch::zeros({1}, torch::kInt64));
  state.key_points = state.key_points + torch::tensor({0.05f, 0.0f, 0.0f});
  run.renderer->CoverStates(*run.field, state);
  const editnerf::Camera& camera = run.scene.frames.front().camera;
  const torch::Tensor rgb = editnerf::RenderImage(*run.field, *run.renderer, camera, state).rgb;
  const torch::Tensor bytes = (rgb * 255).round().clamp(0, 255).to(torch::kUInt8).contiguous();
  std::ofstream file(path, std::ios::binary);
  file << "P6\n" << bytes.size(1) << " " << bytes.size(0) << "\n255\n";
  file.write(reinterpret_cast<const char*>(bytes.data_ptr<uint8_t>()), bytes.numel());
}

}  // namespace

int main(int argc, char** argv) {
  if (argc != 3) {
    std::cerr << "usage: consumer make RUN | consumer RUN IMAGE\n";
    return 2;
  }
  try {
    if (std::string(argv[1]) == "make") {
      MakeSmallRun(argv[2]);
    } else {
      RenderEdit(argv[1], argv[2]);
    }
    return 0;
  } catch (const editnerf::Error& error) {
    std::cerr << error.what() << "\n";
    return 1;
  }
}
