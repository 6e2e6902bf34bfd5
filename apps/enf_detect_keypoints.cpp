// enf-detect-keypoints SCENE --pretrained RUN: key points and their initial tracks from a pretrained field.
#include <cstdio>
#include <filesystem>
#include <optional>
#include <string>

#include "libeditnerf/config/yaml.h"
#include "libeditnerf/imaging/scene_folder.h"
#include "libeditnerf/tracking/detection_run.h"
#include "support/run.h"

int main(int argc, char** argv) {
  using namespace editnerf;
  std::filesystem::path scene_folder, pretrained, out;
  std::optional<int64_t> count;
  return RunProgram(
      "enf-detect-keypoints", "Finds the key points of a scene and their initial tracks.", argc, argv,
      [&](CLI::App& app) {
        app.add_option("SCENE", scene_folder, "scene folder")->required();
        app.add_option("--pretrained", pretrained, "run folder of enf-pretrain")->required();
        app.add_option("--count", count, "number of key points; without it as many as are found");
        app.add_option("--out", out, "folder for the results; SCENE by default");
      },
      [&](const CommonOptions& common) {
        Config config = common.config;
        if (count) ApplyOverride(config, "detect.count=" + std::to_string(*count), "--count");
        const Scene scene = ReadSceneFolder(scene_folder, config.data);
        const PretrainedMaps maps = ReadPretrainedMaps(pretrained, scene);
        const DetectionRun run = RunDetection(scene, maps, config.detect);
        WriteDetection(scene, maps, run, out.empty() ? scene_folder : out);
        std::printf("key points: %lld\n", static_cast<long long>(run.detection.count()));
      });
}
