#include "libeditnerf/tracking/detection_run.h"

#include <fmt/format.h>

#include <string>

#include "libeditnerf/base/logging.h"
#include "libeditnerf/base/shape.h"
#include "libeditnerf/evaluation/depth_error.h"
#include "libeditnerf/tracking/clip.h"
#include "libeditnerf/tracking/flow_cache.h"
#include "libeditnerf/tracking/motion_flow.h"
#include "libeditnerf/tracking/steady_places.h"
#include "libeditnerf/tracking/still_depth.h"
#include "libeditnerf/tracking/still_flow.h"

namespace editnerf {
namespace {

constexpr int64_t kWidthsPerReach = 160;  // image widths to the pixels around a triangulated one
constexpr double kSmallestRange = 0.01;   // scene units

FlowSequence FlowsOf(const Scene& scene, const PretrainedMaps& pretrained, const OpticalFlow& flow,
                     const std::filesystem::path& flow_cache) {
  const torch::Tensor images = scene.images.index_select(0, torch::tensor(scene.train));
  if (!flow.GainsFromGuess()) {
    return flow_cache.empty() ? ComputeFlowSequence(images, flow)
                              : CachedFlowSequence(images, flow, flow_cache, /*keep=*/false);
  }
  const auto camera = [&](int64_t t) -> const Camera& {
    return scene.frames[static_cast<size_t>(scene.train[static_cast<size_t>(t)])].camera;
  };
  const FlowSequence flows = ComputeFlowSequence(images, flow, [&](int64_t from, int64_t to) {
    return StillFlow(camera(from), pretrained.depth[from], camera(to));
  });
  return CarryMotionOn(images, flow, flows);
}

std::string LampNote(const std::optional<Lamp>& lamp) {
  if (!lamp) return "light: no direction stands out in what parts shade";
  const Vec3& to = lamp->direction;
  return fmt::format(
      "light comes from ({:.2f}, {:.2f}, {:.2f}), scene axes: that explains {:.0f} % of what is in the shade when, "
      "most directions {:.0f} %",
      to.x, to.y, to.z, 100 * lamp->explained, 100 * lamp->usual);
}

}  // namespace

DetectionRun RunDetection(const Scene& scene, const PretrainedMaps& pretrained, const DetectionConfig& config,
                          const OpticalFlow& flow, const std::filesystem::path& flow_cache) {
  pretrained.Check(scene);
  DetectionRun run;
  run.flows = FlowsOf(scene, pretrained, flow, flow_cache);
  const int64_t reach = std::max<int64_t>(1, scene.width() / kWidthsPerReach);
  run.still_depth =
      TriangulateStillDepth(MakeClip(scene, pretrained.depth, run.flows), scene.transform.near, scene.transform.far);
  run.depth = PutKnownDepth(pretrained.depth, run.still_depth, reach);
  PretrainedMaps maps = pretrained;
  maps.depth = run.depth;
  run.detection = DetectKeyPoints(scene, maps, run.flows, flow, config);
  run.depth = PutKnownDepth(run.depth, run.detection.part_depth, reach);
  if (run.detection.part_depth.size() > 0) {
    LogInfo("rigid parts: {} places known", run.detection.part_depth.size());
    LogDepthTargetErrors(scene, run.detection.part_depth);
  }
  const int64_t unsteady =
      MarkUnsteadyPlaces(MakeClip(scene, run.depth, run.flows), run.detection.part_depth, &run.still_depth);
  LogInfo("{} of {} places that stand still are on parts at rest, or in light that changes", unsteady,
          run.still_depth.size());
  if (config.refine && run.detection.count() > 0) {
    run.refined = RefineTracks(MakeClip(scene, run.depth, run.flows), &run.detection);
  }
  if (run.detection.count() > 1) {
    run.lamp = FindLamp(MakeClip(scene, run.depth, run.flows), run.still_depth, run.detection.part_depth,
                        run.detection.tracks);
    run.detection.notes.push_back(LampNote(run.lamp));
  }
  run.detection.notes.insert(run.detection.notes.begin(), "optical flow: " + flow.Name());
  for (const std::string& note : run.detection.notes) LogInfo("detection: {}", note);
  for (size_t n = 0; n < run.refined.size(); ++n) {
    const TrackResiduals &before = run.refined[n].before, &after = run.refined[n].after;
    LogInfo("key point {}: motion residual {:.3f} -> {:.3f} pixels, depth residual {:.4f} -> {:.4f} scene units", n,
            before.motion, after.motion, before.geometry, after.geometry);
  }
  if (run.detection.count() == 0) {
    LogWarning("{}: no key points found: {}", scene.name,
               run.detection.notes.empty() ? "" : run.detection.notes.back());
  }
  return run;
}

LocalCoordinates ToLocalCoordinates(const torch::Tensor& tracks) {
  CheckShape(tracks, {kAny, kAny, 3}, "key point tracks");
  const torch::Tensor positions = tracks.to(torch::kFloat64);
  LocalCoordinates result;
  if (positions.size(1) == 0) {
    result.local = positions;
    result.scale = torch::zeros({0}, torch::kFloat64);
    result.offset = torch::zeros({0, 3}, torch::kFloat64);
    return result;
  }
  const torch::Tensor spread = torch::quantile(positions, 0.9, 0) - torch::quantile(positions, 0.1, 0);
  const torch::Tensor range = std::get<0>(spread.max(1));
  for (int64_t n = 0; n < range.size(0); ++n) {
    if (range[n].item<double>() < kSmallestRange) {
      LogWarning("key point {}: its track moves by {:.4f} scene units only; its scale is that of {}", n,
                 range[n].item<double>(), kSmallestRange);
    }
  }
  result.scale = 1 / range.clamp_min(kSmallestRange);
  const torch::Tensor scaled = positions * result.scale.view({1, -1, 1});
  result.offset = -scaled.mean(0);
  result.local = scaled + result.offset;
  return result;
}

}  // namespace editnerf
