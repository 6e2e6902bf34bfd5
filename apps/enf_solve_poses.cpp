// enf-solve-poses: from a video or a folder of images to a scene folder with camera poses.
#include <CLI/CLI.hpp>
#include <string>

#include "libeditnerf/base/interrupt.h"
#include "libeditnerf/poses/solve_poses.h"
#include "support/run.h"

int main(int argc, char** argv) {
  using namespace editnerf;
  std::string input, scene;
  SolvePosesOptions options;
  CLI::App app("Camera poses for a video or a folder of images, by COLMAP");
  app.add_option("input", input,
                 "video, folder of images, or a solved data set (transforms.json, folder with poses_bounds.npy)")
      ->required();
  app.add_option("--out", scene, "scene folder to write")->required();
  app.add_option("--colmap-model", options.colmap_model,
                 "folder with a COLMAP model of these images; COLMAP is not run");
  app.add_option("--max-frames", options.max_frames, "frames taken, evenly spaced")->capture_default_str();
  app.add_option("--camera-model", options.colmap.camera_model, "COLMAP camera model")
      ->check(CLI::IsMember({"SIMPLE_PINHOLE", "PINHOLE", "SIMPLE_RADIAL", "RADIAL", "OPENCV"}))
      ->capture_default_str();
  app.add_flag("--force", options.force, "replace an existing scene");
  try {
    app.parse(argc, argv);
  } catch (const CLI::ParseError& error) {
    return app.exit(error) == 0 ? 0 : 2;
  }
  InstallInterruptHandler();
  return RunProgram([&] { SolvePoses(input, scene, options); });
}
