#include <nlohmann/json.hpp>

#include "libeditnerf/base/error.h"
#include "libeditnerf/base/file.h"
#include "libeditnerf/base/safetensors.h"
#include "libeditnerf/base/shape.h"
#include "libeditnerf/imaging/image_file.h"
#include "libeditnerf/imaging/json_file.h"
#include "libeditnerf/imaging/key_point_files.h"
#include "libeditnerf/tracking/detection_pictures.h"
#include "libeditnerf/tracking/detection_run.h"

namespace editnerf {
namespace {

namespace fs = std::filesystem;

// Nothing known leaves no file, also none of an earlier detection.
void WriteOrRemove(const fs::path& path, const DepthTargets& targets) {
  if (targets.size() > 0) return WriteDepthTargets(path, targets);
  std::error_code ignored;
  fs::remove(path, ignored);
}

void WriteOrRemove(const fs::path& path, const torch::Tensor& turns) {
  if (turns.defined()) return WriteSafetensors(path, {{"turns", turns}});
  std::error_code ignored;
  fs::remove(path, ignored);
}

nlohmann::json Describe(const TrackResiduals& residuals) {
  return {{"motion_pixels", residuals.motion},
          {"motion_terms", residuals.motion_terms},
          {"geometry_scene_units", residuals.geometry},
          {"geometry_terms", residuals.geometry_terms},
          {"skip_pixels", residuals.skip},
          {"skip_terms", residuals.skip_terms}};
}

nlohmann::json Describe(const Scene& scene, const DetectionRun& run) {
  const Detection& detection = run.detection;
  const auto id_of = [&scene](int64_t t) {
    return scene.frames[static_cast<size_t>(scene.train[static_cast<size_t>(t)])].id;
  };
  nlohmann::json points = nlohmann::json::array();
  for (int64_t n = 0; n < detection.count(); ++n) {
    const auto i = static_cast<size_t>(n);
    const float* p = detection.reference.data_ptr<float>() + 3 * n;
    nlohmann::json visible = nlohmann::json::array();
    for (int64_t t = 0; t < detection.visible.size(0); ++t) visible.push_back(detection.visible[t][n].item<bool>());
    nlohmann::json skips = nlohmann::json::array();
    for (const SkipLink& link : detection.pixel_tracks[i].links) skips.push_back(id_of(link.frame));
    nlohmann::json point = {{"reference", {p[0], p[1], p[2]}},
                            {"reference_frame", id_of(detection.reference_frame[i])},
                            {"score", detection.score[n].item<double>()},
                            {"visible", visible},
                            {"skips", skips}};
    if (i < run.refined.size()) {
      point["residuals_before"] = Describe(run.refined[i].before);
      point["residuals_after"] = Describe(run.refined[i].after);
    }
    points.push_back(point);
  }
  nlohmann::json ids = nlohmann::json::array();
  for (size_t t = 0; t < scene.train.size(); ++t) ids.push_back(id_of(static_cast<int64_t>(t)));
  nlohmann::json lamp;
  if (run.lamp) lamp = {run.lamp->direction.x, run.lamp->direction.y, run.lamp->direction.z};
  return {{"count", detection.count()}, {"units", "scene"},     {"lamp", lamp},
          {"training_ids", ids},        {"key_points", points}, {"candidates", detection.candidates.size()},
          {"notes", detection.notes}};
}

}  // namespace

void WriteDetection(const Scene& scene, const DetectionRun& run, const std::filesystem::path& folder) {
  MakeFolder(folder / "data");
  MakeFolder(folder / "depth");
  MakeFolder(folder / "flow");
  if (run.detection.count() > 0) {
    const LocalCoordinates coordinates = ToLocalCoordinates(run.detection.tracks);
    WriteKeyPointFiles(folder, {coordinates.local, coordinates.scale, coordinates.offset});
  }
  for (size_t t = 0; t < scene.train.size(); ++t) {
    const std::string& id = scene.frames[static_cast<size_t>(scene.train[t])].id;
    WriteMedianDepth(folder, id, run.depth[static_cast<int64_t>(t)]);
    if (t + 1 < scene.train.size()) WriteFlow(folder, id, run.flows.forward[static_cast<int64_t>(t)]);
  }
  WriteOrRemove(StillDepthPath(folder), run.still_depth);
  WriteOrRemove(PartDepthPath(folder), run.detection.part_depth);
  WriteOrRemove(PartTurnsPath(folder), run.detection.turns);
  WriteFileAtomically(folder / "data" / "detection.json", Describe(scene, run).dump(2) + "\n");
  WritePng(folder / "data" / "variance.png", VariancePicture(run.detection));
  WritePng(folder / "data" / "motion.png", MotionPicture(scene, run.detection));
  WritePng(folder / "data" / "tracks.png", TracksPicture(scene, run.detection));
}

fs::path StillDepthPath(const fs::path& folder) { return folder / "data" / "still_depth.safetensors"; }

fs::path PartDepthPath(const fs::path& folder) { return folder / "data" / "part_depth.safetensors"; }

fs::path PartTurnsPath(const fs::path& folder) { return folder / "data" / "part_turns.safetensors"; }

torch::Tensor ReadPartTurns(const fs::path& folder, int64_t frames, int64_t key_points) {
  const fs::path path = PartTurnsPath(folder);
  if (!fs::exists(path)) return {};
  SafetensorsFile file = ReadSafetensors(path);
  if (file.tensors.count("turns") == 0) Throw<DataError>("{}: found no tensor \"turns\"", path.string());
  torch::Tensor turns = file.tensors["turns"];
  if (turns.scalar_type() != torch::kFloat32 || turns.sizes() != torch::IntArrayRef({frames, key_points, 3})) {
    Throw<DataError>("{}: expected turns float32 [{}, {}, 3], found {}; detect again", path.string(), frames,
                     key_points, ShapeString(turns));
  }
  if (!turns.isfinite().all().item<bool>()) Throw<DataError>("{}: a turn is not finite", path.string());
  return turns;
}

std::optional<Vec3> ReadLamp(const fs::path& folder) {
  const fs::path path = folder / "data" / "detection.json";
  if (!fs::exists(path)) return std::nullopt;
  const Json json = ReadJson(path);
  if (!json.is_object() || !json.contains("lamp") || json["lamp"].is_null()) return std::nullopt;
  const std::vector<double> to = JsonNumbers(json, "lamp", 3, path.string());
  const Vec3 lamp = {to[0], to[1], to[2]};
  if (const double length = Norm(lamp); !(length > 0.5 && length < 2)) {
    Throw<DataError>("{}: lamp: expected a direction of length 1, found one of {:g}", path.string(), length);
  }
  return Normalized(lamp);
}

}  // namespace editnerf
