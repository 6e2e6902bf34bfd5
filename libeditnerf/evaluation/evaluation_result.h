// Scores of an evaluation, per frame and averaged, and their JSON.
//
//   {"reconstruction.psnr": 31.2, "reconstruction.frames": 16, "editing.ms_ssim": 0.98, ..., "key_points.count": 2,
//    "seconds.train": 312.5, ..., "frames": {"reconstruction": [{"id": "000003", "psnr": 30.9, ...}, ...], ...}}
//
// Metrics: psnr [dB], ssim, ms_ssim, lpips (where its weights were given), psnr_moving [dB] (over the moving pixels,
// where ground truth has any), and whatever else the caller measures. A mean is over the frames that have the metric.
// NaN and infinity become null.
#pragma once

#include <torch/types.h>

#include <cstdint>
#include <map>
#include <nlohmann/json.hpp>
#include <string>
#include <utility>
#include <vector>

#include "libeditnerf/evaluation/lpips.h"

namespace editnerf {

struct FrameScore {
  std::string id;
  std::map<std::string, double> metrics;
};

// All metrics of one image [H, W, 3] in [0, 1] against the true one. `moving` [H, W] may be undefined, `lpips` empty.
// Metrics whose windows do not fit into the image are left out; where MS-SSIM has fewer than five scales, their number
// is given as ms_ssim_scales.
FrameScore MeasureFrame(const std::string& id, const torch::Tensor& image, const torch::Tensor& truth,
                        const torch::Tensor& moving, Lpips lpips);

struct ProtocolResult {
  std::string name;  // "reconstruction", "interpolation", "editing"; baselines: "editing_nearest", ...
  std::vector<FrameScore> frames;

  std::map<std::string, double> Means() const;
};

struct EvaluationResult {
  std::vector<ProtocolResult> protocols;
  int64_t num_key_points = 0;
  std::vector<std::pair<std::string, double>> stage_seconds;  // in order
};

nlohmann::json ToJson(const EvaluationResult& result);

}  // namespace editnerf
