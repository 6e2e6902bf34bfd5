// EditableNeRF's additions to a scene folder: key point tracks, median depth and optical flow.
//
//   data/k_points_auto.txt          one row per training frame, 3 N numbers: q of key points 0 .. N - 1
//   data/k_points_auto_coor_I.txt   of key point I (from 0; files that count from 1 are read too): s and the 3 of b
//   depth/depth_median_ID.npy       float32 [H, W], distance from the camera centre, scene units; NaN: no surface
//   flow/flow_ID.npy                float32 [H, W, 2], from this training frame to the next, pixels (x, y)
//
// Local coordinates, as in the supplement of EditableNeRF: q = s k + b, with k in scene units.
// All functions throw DataError naming the file and what was expected, ShapeError for wrong tensors.
#pragma once

#include <torch/types.h>

#include <filesystem>
#include <string>
#include <vector>

namespace editnerf {

struct KeyPointFiles {
  torch::Tensor local;   // [T, N, 3] float64, q
  torch::Tensor scale;   // [N] float64, s > 0
  torch::Tensor offset;  // [N, 3] float64, b

  torch::Tensor InSceneUnits() const;  // [T, N, 3] float64, k = (q - b) / s
};

bool HasKeyPointFiles(const std::filesystem::path& folder);
KeyPointFiles ReadKeyPointFiles(const std::filesystem::path& folder);
void WriteKeyPointFiles(const std::filesystem::path& folder, const KeyPointFiles& key_points);

// `folder` is the scene folder in all of these.
torch::Tensor ReadMedianDepth(const std::filesystem::path& folder, const std::string& id);
void WriteMedianDepth(const std::filesystem::path& folder, const std::string& id, const torch::Tensor& depth);
torch::Tensor ReadFlow(const std::filesystem::path& folder, const std::string& id);
void WriteFlow(const std::filesystem::path& folder, const std::string& id, const torch::Tensor& flow);

// All frames of one size: [T, H, W] for the T ids; [T - 1, H, W, 2] for the flows of all ids but the last, which has
// none.
torch::Tensor ReadMedianDepths(const std::filesystem::path& folder, const std::vector<std::string>& ids);
torch::Tensor ReadFlows(const std::filesystem::path& folder, const std::vector<std::string>& ids);

}  // namespace editnerf
