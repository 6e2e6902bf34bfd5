// enf-detect-keypoints SCENE --pretrained RUN: key points and their initial tracks from a pretrained field.
#include <filesystem>

#include "libeditnerf/base/logging.h"
#include "libeditnerf/pipeline/stages.h"
#include "libeditnerf/tracking/detection_run.h"
#include "libeditnerf/tracking/flow_cache.h"
#include "libeditnerf/tracking/flow_choice.h"
#include "support/run.h"

int main(int argc, char** argv) {
  using namespace editnerf;
  std::filesystem::path folder, pretrained, out;
  int64_t count = 0;
  CLI::Option* count_flag = nullptr;
  return RunProgram(
      "enf-detect-keypoints", "Finds the key points of a scene and their initial tracks.", argc, argv,
      [&](CLI::App& app) {
        app.add_option("SCENE", folder, "scene folder")->required();
        app.add_option("--pretrained", pretrained, "run folder of enf-pretrain")->required();
        count_flag = app.add_option("--count", count, "number of key points; 0 keeps as many as are found")
                         ->check(CLI::Range(0, 64));
        app.add_option("--out", out, "folder for the results; SCENE by default");
      },
      [&](const CommonOptions& common) {
        Config config = common.config;
        if (count_flag->count() > 0) config.detect.count = count;
        const Scene scene = OpenScene(folder, config.data);
        const PretrainedMaps maps = ReadPretrainedMaps(pretrained, scene);
        const DetectionRun run =
            RunDetection(scene, maps, config.detect, *MakeOpticalFlow(config.flow), FlowCachePath(pretrained));
        WriteDetection(scene, run, out.empty() ? folder : out);
        LogInfo("key points: {}", run.detection.count());
      });
}
