#include "libeditnerf/evaluation/evaluation_result.h"

#include <torch/types.h>
#include <torch/utils.h>

#include <limits>

#include "libeditnerf/evaluation/image_metrics.h"
#include "tests/catch.h"

using namespace editnerf;

TEST_CASE("a frame gets every metric that its size and inputs allow") {
  torch::manual_seed(2);
  const auto truth = torch::rand({24, 30, 3}), image = (truth + 0.05 * torch::randn_like(truth)).clamp(0, 1);
  auto moving = torch::zeros({24, 30}, torch::kUInt8);
  const FrameScore plain = MeasureFrame("7", image, truth, {}, nullptr);
  CHECK(plain.id == "7");
  CHECK(plain.metrics.size() == 4);
  CHECK(plain.metrics.at("psnr") == Psnr(image, truth));
  CHECK(plain.metrics.at("ssim") == Ssim(image, truth));
  CHECK(plain.metrics.at("ms_ssim_scales") == 2);
  CHECK(MeasureFrame("7", image, truth, moving, nullptr).metrics.count("psnr_moving") == 0);
  moving.slice(0, 0, 3) = 1;
  const FrameScore full = MeasureFrame("7", image, truth, moving, Lpips());
  CHECK(full.metrics.at("psnr_moving") == MaskedPsnr(image, truth, moving).value());
  CHECK(full.metrics.count("lpips") == 1);
  CHECK(MeasureFrame("7", image.slice(0, 0, 10), truth.slice(0, 0, 10), {}, Lpips()).metrics.size() == 1);
}

TEST_CASE("the evaluation's JSON has flat means, per-frame values, counts and seconds") {
  EvaluationResult result;
  result.protocols.push_back({"reconstruction", {{"a", {{"psnr", 30}, {"lpips", 0.5}}}, {"b", {{"psnr", 34}}}}});
  result.protocols.push_back({"editing", {{"c", {{"ms_ssim", std::numeric_limits<double>::quiet_NaN()}}}}});
  result.num_key_points = 2;
  result.stage_seconds = {{"pretrain", 12.5}, {"train", 60}};
  const auto json = nlohmann::json::parse(ToJson(result).dump());
  CHECK(json.at("reconstruction.psnr") == 32.0);
  CHECK(json.at("reconstruction.lpips") == 0.5);
  CHECK(json.at("reconstruction.frames") == 2);
  CHECK(json.at("editing.ms_ssim").is_null());
  CHECK(json.at("key_points.count") == 2);
  CHECK(json.at("seconds.pretrain") == 12.5);
  CHECK(json.at("frames").at("reconstruction").at(1).at("id") == "b");
  CHECK(json.at("frames").at("reconstruction").at(1).at("psnr") == 34.0);
  CHECK(ToJson({}).at("frames").empty());
}
