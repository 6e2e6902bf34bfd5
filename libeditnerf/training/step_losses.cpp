#include "libeditnerf/training/step_losses.h"

#include <torch/types.h>

#include "libeditnerf/training/losses.h"

namespace editnerf {

StepLosses RayLosses(const Run& run, const RayBatch& rays, const RayColors& colors, const FrameStates& states,
                     const RayOptions& options) {
  const StageConfig& stage = StageOf(run);
  const RayResult result = run.renderer->Render(*run.field, rays, states, options);
  StepLosses found{{}, (result.rgb.detach() - colors.target).square().mean(1), result.samples};
  NamedTensors& losses = found.terms;
  losses.emplace_back("reconstruction",
                      ReconstructionLoss(result.rgb, result.rgb_coarse, colors.target, colors.emphasis));
  if (run.config.field.HasWarp() && stage.lambda_warp > 0) {
    losses.emplace_back(
        "warp", stage.lambda_warp * WarpRegularisation(result.x_observed, result.x_canonical, result.depth_valid));
  }
  if (run.stage == FieldStage::kPretrain && stage.lambda_ambient > 0) {
    losses.emplace_back("ambient", stage.lambda_ambient * AmbientRegularisation(result.ambient, result.depth_valid));
  }
  if (stage.lambda_distortion > 0) {
    losses.emplace_back("distortion", stage.lambda_distortion * result.distortion.mean());
  }
  if (result.depth_miss.defined()) losses.emplace_back("depth", stage.lambda_depth * result.depth_miss);
  return found;
}

NamedTensors KeyPointLosses(const StageConfig& stage, const CameraTensors& cameras,
                            const KeyPointSupervision& supervision, const torch::Tensor& key_points) {
  const int64_t frames = cameras.size();
  NamedTensors losses;
  if (frames < 2) return losses;
  FramePairs pairs;
  pairs.frame = torch::arange(frames - 1, torch::kInt64).to(key_points.device());
  pairs.key_points = key_points.slice(0, 0, frames - 1);
  pairs.key_points_next = key_points.slice(0, 1, frames);
  if (stage.lambda_motion > 0) {
    losses.emplace_back("motion",
                        stage.lambda_motion * MotionLoss(cameras, supervision.flow, pairs, stage.reference_width));
  }
  if (stage.lambda_geometry > 0) {
    losses.emplace_back("geometry", stage.lambda_geometry * GeometryLoss(cameras, supervision.depth, pairs));
  }
  return losses;
}

}  // namespace editnerf
