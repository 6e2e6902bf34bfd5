// enf-train SCENE --out RUN: trains the editable field from the key points that detection left in the scene folder.
#include <filesystem>

#include "libeditnerf/pipeline/stages.h"
#include "support/run.h"

int main(int argc, char** argv) {
  editnerf::StageRequest request;
  std::filesystem::path detection;
  double seconds = 0;
  CLI::Option* budget = nullptr;
  return editnerf::RunProgram(
      "enf-train", "Trains the editable field.", argc, argv,
      [&](CLI::App& app) {
        app.add_option("SCENE", request.scene_folder, "scene folder, or packed scene")->required();
        app.add_option("--out", request.out, "run folder")->required();
        app.add_option("--key-points", detection, "folder of enf-detect-keypoints --out; SCENE by default");
        app.add_option("--pretrained", request.pretrained, "run folder of enf-pretrain, for train.warm_start");
        app.add_flag("--resume", request.resume, "continue from the checkpoint in the run folder");
        budget =
            app.add_option("--time-budget", seconds, "training seconds (train.seconds)")->check(CLI::PositiveNumber);
      },
      [&](const editnerf::CommonOptions& common) {
        request.config = common.config;
        request.device = common.device;
        if (budget->count() > 0) request.config.train.seconds = seconds;
        editnerf::RunTraining(editnerf::OpenScene(request.scene_folder, request.config.data), request,
                              detection.empty() ? request.scene_folder : detection);
      });
}
