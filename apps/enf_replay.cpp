// enf-replay STEP: computes a step again that training skipped because it was not finite (train.dump_bad_steps).
#include <cstdio>
#include <filesystem>

#include "libeditnerf/training/step_replay.h"
#include "support/run.h"

int main(int argc, char** argv) {
  std::filesystem::path step;
  return editnerf::RunProgram(
      "enf-replay", "Computes a skipped step of training again.", argc, argv,
      [&](CLI::App& app) { app.add_option("STEP", step, "folder of the step: RUN/bad_steps/NUMBER")->required(); },
      [&](const editnerf::CommonOptions& common) {
        std::printf("%s", ToText(editnerf::ReplayStep(step, common.device)).c_str());
      });
}
