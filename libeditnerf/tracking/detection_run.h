// The detection stage from maps to files: flow, key points, refinement, and everything that training and people read.
#pragma once

#include <torch/types.h>

#include <filesystem>
#include <optional>
#include <vector>

#include "libeditnerf/config/config.h"
#include "libeditnerf/scene/scene.h"
#include "libeditnerf/tracking/key_point_detection.h"
#include "libeditnerf/tracking/lamp.h"
#include "libeditnerf/tracking/track_refinement.h"

namespace editnerf {

struct DetectionRun {
  Detection detection;                // tracks are the refined ones where config.refine
  std::vector<RefinedTrack> refined;  // N; empty without config.refine
  FlowSequence flows;
  torch::Tensor depth;       // [T, H, W] float32, the pretrained maps with known distances in their places
  DepthTargets still_depth;  // by triangulation of what stands still; those of rigid parts: detection.part_depth
  std::optional<Lamp> lamp;  // of several key points, where their shadows tell it
};

// Flow of the training images, detection, refinement. Notes, of which the first names the flow, go to the log; a
// warning says so when nothing was found.
//
// A flow that gains from a guess begins from what cameras and the pretrained depth explain (still_flow.h). Another
// one's is that of the images alone, and is read from `flow_cache` (flow_cache.h), where given and there.
DetectionRun RunDetection(const Scene& scene, const PretrainedMaps& pretrained, const DetectionConfig& config,
                          const OpticalFlow& flow = DisFlow(), const std::filesystem::path& flow_cache = {});

// Local coordinates of EditableNeRF's supplement: q = s k + b with s = 1 / max over axes of (90th - 10th percentile of
// the track), b = -mean of the scaled track. A range under 0.01 scene units counts as that much, with a warning.
struct LocalCoordinates {
  torch::Tensor local;   // [T, N, 3] float64
  torch::Tensor scale;   // [N] float64
  torch::Tensor offset;  // [N, 3] float64
};
LocalCoordinates ToLocalCoordinates(const torch::Tensor& tracks);  // [T, N, 3], scene units

// Into `folder` (a scene folder): data/k_points_auto.txt and k_points_auto_coor_I.txt (where there are key points),
// data/detection.json, data/variance.png, data/motion.png, data/tracks.png, depth/depth_median_ID.npy,
// flow/flow_ID.npy, data/still_depth.safetensors, data/part_depth.safetensors, data/part_turns.safetensors. Throws
// DataError naming the file that cannot be written.
void WriteDetection(const Scene& scene, const DetectionRun& run, const std::filesystem::path& folder);

// Where WriteDetection leaves known distances and turns; absent where there are none.
std::filesystem::path StillDepthPath(const std::filesystem::path& folder);
std::filesystem::path PartDepthPath(const std::filesystem::path& folder);
std::filesystem::path PartTurnsPath(const std::filesystem::path& folder);

// The rotation vectors [T, N, 3] of N key points' parts in T training frames; undefined where there is no such file.
// Throws CheckpointError or DataError naming it where it is broken or does not fit.
torch::Tensor ReadPartTurns(const std::filesystem::path& folder, int64_t frames, int64_t key_points);

// Towards the lamp, unit length, scene axes, from data/detection.json; nothing where there is no such file or no lamp
// in it. Throws DataError naming it where it is broken.
std::optional<Vec3> ReadLamp(const std::filesystem::path& folder);

}  // namespace editnerf
