// enf-pretrain SCENE --out RUN: the HyperNeRF stage, whose depth and ambient coordinates the key points are found with.
#include <filesystem>

#include "libeditnerf/pipeline/stages.h"
#include "support/run.h"

int main(int argc, char** argv) {
  editnerf::StageRequest request;
  double seconds = 0;
  CLI::Option* budget = nullptr;
  return editnerf::RunProgram(
      "enf-pretrain", "Trains the HyperNeRF stage: depth and ambient coordinates for key point detection.", argc, argv,
      [&](CLI::App& app) {
        app.add_option("SCENE", request.scene_folder, "scene folder, or packed scene")->required();
        app.add_option("--out", request.out, "run folder")->required();
        app.add_flag("--resume", request.resume, "continue from the checkpoint in the run folder");
        budget =
            app.add_option("--time-budget", seconds, "training seconds (pretrain.seconds)")->check(CLI::PositiveNumber);
      },
      [&](const editnerf::CommonOptions& common) {
        request.config = common.config;
        request.device = common.device;
        if (budget->count() > 0) request.config.pretrain.seconds = seconds;
        editnerf::RunPretraining(editnerf::OpenScene(request.scene_folder, request.config.data), request);
      });
}
