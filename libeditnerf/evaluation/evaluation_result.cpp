#include "libeditnerf/evaluation/evaluation_result.h"

#include <algorithm>

#include "libeditnerf/evaluation/image_metrics.h"

namespace editnerf {

FrameScore MeasureFrame(const std::string& id, const torch::Tensor& image, const torch::Tensor& truth,
                        const torch::Tensor& moving, Lpips lpips) {
  constexpr int64_t kSsimWindow = 11, kLpipsSide = 17, kFullScales = 5;
  FrameScore score;
  score.id = id;
  score.metrics["psnr"] = Psnr(image, truth);
  const int64_t side = std::min(image.size(0), image.size(1));
  if (side >= kSsimWindow) {
    score.metrics["ssim"] = Ssim(image, truth);
    const MsSsimResult ms_ssim = MsSsim(image, truth);
    score.metrics["ms_ssim"] = ms_ssim.value;
    if (ms_ssim.num_scales < kFullScales) score.metrics["ms_ssim_scales"] = static_cast<double>(ms_ssim.num_scales);
  }
  if (lpips && side >= kLpipsSide) score.metrics["lpips"] = lpips->Distance(image, truth);
  if (moving.defined()) {
    if (const auto psnr = MaskedPsnr(image, truth, moving)) score.metrics["psnr_moving"] = *psnr;
  }
  return score;
}

std::map<std::string, double> ProtocolResult::Means() const {
  std::map<std::string, double> sums;
  std::map<std::string, int64_t> counts;
  for (const FrameScore& frame : frames) {
    for (const auto& [metric, value] : frame.metrics) sums[metric] += value, ++counts[metric];
  }
  for (auto& [metric, sum] : sums) sum /= static_cast<double>(counts[metric]);
  return sums;
}

nlohmann::json ToJson(const EvaluationResult& result) {
  nlohmann::json json = {{"key_points.count", result.num_key_points}};
  auto& per_frame = json["frames"] = nlohmann::json::object();
  for (const ProtocolResult& protocol : result.protocols) {
    json[protocol.name + ".frames"] = protocol.frames.size();
    for (const auto& [metric, mean] : protocol.Means()) json[protocol.name + "." + metric] = mean;
    auto rows = nlohmann::json::array();
    for (const FrameScore& frame : protocol.frames) {
      nlohmann::json row = {{"id", frame.id}};
      for (const auto& [metric, value] : frame.metrics) row[metric] = value;
      rows.push_back(std::move(row));
    }
    per_frame[protocol.name] = std::move(rows);
  }
  for (const auto& [stage, seconds] : result.stage_seconds) json["seconds." + stage] = seconds;
  return json;
}

}  // namespace editnerf
