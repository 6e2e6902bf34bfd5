// From a video or a folder of images to a scene folder with camera poses.
#pragma once

#include <cstdint>
#include <filesystem>
#include <limits>
#include <string>
#include <utility>
#include <vector>

#include "libeditnerf/poses/colmap_runner.h"

namespace editnerf {

struct SolvePosesOptions {
  std::filesystem::path colmap_model;  // an already solved model for the images; empty: run COLMAP
  int64_t max_frames = 200;            // > 0; taken evenly from a longer video or folder
  bool force = false;                  // replace an existing scene
  double min_registered_share = 0.5;   // fewer registered frames are an error
  ColmapOptions colmap;
};

struct PosesReport {
  std::string source;                // "COLMAP", "COLMAP model", "transforms.json" or "LLFF"
  int64_t total = 0;                 // frames given to pose estimation
  int64_t registered = 0;            // frames with a pose
  std::vector<std::string> missing;  // ids without one
  double mean_reprojection_error = std::numeric_limits<double>::quiet_NaN();  // pixels; NaN: unknown
  int64_t num_points = 0;
  double near = 0, far = 0;                             // scene units
  std::vector<std::pair<std::string, double>> seconds;  // per stage, in order
};

// `input` is a video, a folder of images (in name order; or one with a folder "images" inside), a transforms*.json file
// or a folder with transforms.json, transforms_train.json or poses_bounds.npy (LLFF). The scene folder gets
// rgb/1x/ID.png with ID the frame's number in time order, cameras with their distortion, points.npy, centre, scale,
// near and far, and poses_report.json; COLMAP's own files stay in SCENE/colmap. warp_id is the time order of the
// registered frames. Frames that COLMAP could not place are left out, with a warning; dataset.json names no validation
// frames. Throws ConfigError where the scene is already there and `force` is not given; DataError for input that cannot
// be read, images of different sizes, COLMAP absent or failing, too few frames registered; Interrupted on Ctrl-C.
PosesReport SolvePoses(const std::filesystem::path& input, const std::filesystem::path& scene_folder,
                       const SolvePosesOptions& options);

}  // namespace editnerf
