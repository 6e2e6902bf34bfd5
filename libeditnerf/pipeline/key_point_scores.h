// A run's key points against the true motion of the objects that they lie on.
#pragma once

#include <torch/types.h>

#include <filesystem>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "libeditnerf/evaluation/protocols.h"
#include "libeditnerf/scene/scene.h"
#include "libeditnerf/training/run.h"

namespace editnerf {

// All key points as training left them, [T, N, 3] float64 on the CPU.
torch::Tensor TrainedTracks(const Run& run);

// The key points of tracks [T, N, 3] with the frame and the object that each belongs to: the reference frame of
// DETECTION_FOLDER/data/detection.json; where that does not exist or has another number of key points, the training
// frame in which the key point is closest to the visible surface of a moving object.
std::vector<ReferenceKeyPoint> ReferencesOf(const Scene& scene, const torch::Tensor& tracks,
                                            const std::filesystem::path& detection_folder);

// One key point against the true motion of the object on which it lies in its reference frame.
struct KeyPointScore {
  ReferenceKeyPoint reference;    // where training left it
  std::string object;             // of GroundTruth::objects; empty: on the static scene
  std::vector<double> distances;  // to the true motion, per training frame, scene units
  double motion_range = 0;        // largest distance between two true positions, scene units
};

// Key points that the reference frames of data/detection.json do not fit take the training frame in which they are
// closest to the visible surface of a moving object. Empty without key points or ground-truth masks.
std::vector<KeyPointScore> MeasureKeyPoints(const Run& run, const Scene& scene,
                                            const std::filesystem::path& detection_folder);

// {"key_points.on_moving_part": 2, "key_points.objects": ["lid", null, "lid"], "key_points.error": 0.01,
//  "key_points.error_share": 0.02, "key_points.error_share_95": 0.05}: over frames and key points, the median distance
// in scene units, and its median and 95th percentile as a share of the key point's motion range (those on moving
// objects). Empty for no scores.
nlohmann::json ToJson(const std::vector<KeyPointScore>& scores);

}  // namespace editnerf
