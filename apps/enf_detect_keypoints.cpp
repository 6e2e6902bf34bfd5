// enf-detect-keypoints SCENE --pretrained RUN: key points and their initial tracks from a pretrained field.
#include "support/run.h"

#if __has_include("support/common_options.h") && __has_include("libeditnerf/imaging/key_point_files.h")
#include <filesystem>
#include <iostream>

#include "libeditnerf/imaging/scene_folder.h"
#include "libeditnerf/tracking/detection_run.h"
#include "support/common_options.h"

int main(int argc, char** argv) {
  using namespace editnerf;
  CLI::App app("Finds the key points of a scene and their initial tracks", "enf-detect-keypoints");
  CommonFlags common;
  common.AddTo(app);
  std::filesystem::path folder, pretrained, out;
  int64_t count = 0;
  app.add_option("SCENE", folder, "scene folder")->required();
  app.add_option("--pretrained", pretrained, "run folder of enf-pretrain")->required();
  auto* count_flag = app.add_option("--count", count, "number of key points; 0 keeps as many as are found");
  app.add_option("--out", out, "folder for the results; SCENE by default");
  try {
    app.parse(argc, argv);
  } catch (const CLI::ParseError& error) {
    return app.exit(error) == 0 ? 0 : 2;
  }
  return RunProgram([&] {
    Config config = common.Apply().config;
    if (count_flag->count() > 0) ApplyOverride(config, "detect.count=" + std::to_string(count), "--count");
    const Scene scene = ReadSceneFolder(folder, config.data);
    const PretrainedMaps maps = ReadPretrainedMaps(pretrained, scene);
    const DetectionRun run = RunDetection(scene, maps, config.detect);
    WriteDetection(scene, maps, run, out.empty() ? folder : out);
    std::cout << "key points: " << run.detection.count() << "\n";
  });
}
#endif
