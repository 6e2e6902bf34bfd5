// enf-solve-poses: from a video or a folder of images to a scene folder with camera poses.
#include <string>

#include "libeditnerf/poses/solve_poses.h"
#include "support/run.h"

int main(int argc, char** argv) {
  std::string input, scene;
  editnerf::SolvePosesOptions options;
  return editnerf::RunProgram(
      "enf-solve-poses", "Camera poses for a video or a folder of images, by COLMAP.", argc, argv,
      [&](CLI::App& app) {
        app.add_option("INPUT", input,
                       "video, folder of images, or a solved data set (transforms.json, folder with poses_bounds.npy)")
            ->required();
        app.add_option("--out", scene, "scene folder to write")->required();
        app.add_option("--colmap-model", options.colmap_model,
                       "folder with a COLMAP model of these images; COLMAP is not run");
        app.add_option("--max-frames", options.max_frames, "frames taken, evenly spaced")
            ->check(CLI::PositiveNumber)
            ->capture_default_str();
        app.add_option("--camera-model", options.colmap.camera_model, "COLMAP camera model")
            ->check(CLI::IsMember({"SIMPLE_PINHOLE", "PINHOLE", "SIMPLE_RADIAL", "RADIAL", "OPENCV"}))
            ->capture_default_str();
        app.add_flag("--force", options.force, "replace an existing scene");
      },
      [&](const editnerf::CommonOptions& common) {
        options.colmap.threads = common.threads;
        options.colmap.seed = common.seed;
        editnerf::SolvePoses(input, scene, options);
      });
}
