#include "libeditnerf/pipeline/key_point_scores.h"

#include <torch/types.h>
#include <torch/utils.h>

#include <algorithm>
#include <cmath>
#include <limits>

#include "libeditnerf/base/error.h"
#include "libeditnerf/base/logging.h"
#include "libeditnerf/base/percentile.h"
#include "libeditnerf/imaging/json_file.h"
#include "libeditnerf/pipeline/stages.h"

namespace editnerf {
namespace {

namespace fs = std::filesystem;

const SceneFrame& FrameAt(const Scene& scene, int64_t frame) { return scene.frames[static_cast<size_t>(frame)]; }

Vec3 PositionAt(const torch::Tensor& tracks, int64_t row, int64_t key_point) {
  const auto values = tracks.accessor<double, 3>()[row][key_point];
  return {values[0], values[1], values[2]};
}

// Rows of scene.train in which detection found the key points; empty where its file is absent or of other key points.
std::vector<int64_t> DetectedReferenceRows(const Scene& scene, int64_t num_key_points, const fs::path& folder) {
  const fs::path path = folder / "data" / "detection.json";
  if (folder.empty() || !fs::exists(path)) return {};
  const Json json = ReadJson(path);
  const Json& points = JsonField(json, "key_points", path.string());
  if (!points.is_array() || static_cast<int64_t>(points.size()) != num_key_points) {
    LogWarning("{}: not of this run, which has {} key points; taking their reference frames from the ground truth",
               path.string(), num_key_points);
    return {};
  }
  std::vector<int64_t> rows;
  for (const Json& point : points) {
    const Json& id = JsonField(point, "reference_frame", path.string());
    const auto found = std::find_if(scene.train.begin(), scene.train.end(), [&](int64_t frame) {
      return id.is_string() && FrameAt(scene, frame).id == id.get<std::string>();
    });
    if (found == scene.train.end()) {
      Throw<DataError>("{}: reference_frame: expected the id of a training frame, found {}", path.string(), id.dump());
    }
    rows.push_back(found - scene.train.begin());
  }
  return rows;
}

// The training frame in which a key point is closest to the visible surface of a moving object; the first for a key
// point that is never seen on one.
int64_t RowOnSurface(const Scene& scene, const torch::Tensor& tracks, int64_t key_point) {
  const torch::Tensor& depth = scene.truth->depth;
  int64_t best = 0;
  double smallest = std::numeric_limits<double>::infinity();
  for (int64_t row = 0; row < tracks.size(0); ++row) {
    const int64_t frame = scene.train[static_cast<size_t>(row)];
    const Vec3 position = PositionAt(tracks, row, key_point);
    if (ObjectAt(scene, frame, position) == kStaticObject) continue;
    double gap = 0;
    if (depth.defined()) {
      const Camera& camera = FrameAt(scene, frame).camera;
      const Projected pixel = Project(camera, position);
      const auto u = static_cast<int64_t>(pixel.u), v = static_cast<int64_t>(pixel.v);  // inside: it has an object
      gap = std::abs(depth[frame][v][u].item<double>() - Norm(position - camera.position));
    }
    if (gap < smallest) smallest = gap, best = row;
  }
  return best;
}

}  // namespace

torch::Tensor TrainedTracks(const Run& run) {
  const torch::Tensor time = torch::arange(static_cast<int64_t>(run.scene.train.size()), torch::kInt64).to(run.device);
  return run.field->key_points()->Positions(time).detach().to(torch::kCPU, torch::kFloat64).contiguous();
}

std::vector<ReferenceKeyPoint> ReferencesOf(const Scene& scene, const torch::Tensor& tracks,
                                            const fs::path& detection_folder) {
  std::vector<int64_t> rows = DetectedReferenceRows(scene, tracks.size(1), detection_folder);
  for (auto n = static_cast<int64_t>(rows.size()); n < tracks.size(1); ++n) {
    rows.push_back(RowOnSurface(scene, tracks, n));
  }
  std::vector<int64_t> frames;
  for (const int64_t row : rows) frames.push_back(scene.train[static_cast<size_t>(row)]);
  return WithObjects(scene, tracks.index({torch::tensor(rows), torch::arange(tracks.size(1))}), frames);
}

std::vector<KeyPointScore> MeasureKeyPoints(const Run& run, const Scene& scene, const fs::path& detection_folder) {
  const torch::NoGradGuard no_grad;
  if (run.field->num_key_points() == 0 || !HasMasks(scene)) return {};
  CheckSameScene(run, scene);
  const torch::Tensor tracks = TrainedTracks(run);
  const std::vector<ReferenceKeyPoint> references = ReferencesOf(scene, tracks, detection_folder);
  std::vector<torch::Tensor> rows;
  for (const int64_t frame : scene.train) rows.push_back(TrueKeyPoints(scene, references, frame));
  const torch::Tensor truth = torch::stack(rows);                                // [T, N, 3]
  const torch::Tensor distances = (tracks - truth).norm(2, 2).t().contiguous();  // [N, T]
  std::vector<KeyPointScore> scores;
  for (size_t i = 0; i < references.size(); ++i) {
    const auto n = static_cast<int64_t>(i);
    const torch::Tensor path = truth.select(1, n);
    const double* first = distances[n].data_ptr<double>();
    KeyPointScore score;
    score.reference = references[i];
    if (score.reference.object != kStaticObject) {
      score.object = scene.truth->objects[static_cast<size_t>(score.reference.object)];
    }
    score.distances.assign(first, first + distances.size(1));
    score.motion_range = (path.unsqueeze(0) - path.unsqueeze(1)).norm(2, 2).max().item<double>();
    scores.push_back(std::move(score));
  }
  return scores;
}

nlohmann::json ToJson(const std::vector<KeyPointScore>& scores) {
  auto json = nlohmann::json::object();
  if (scores.empty()) return json;
  const auto quantile = [](const std::vector<double>& values, double share) {
    if (values.empty()) return std::numeric_limits<double>::quiet_NaN();  // null in the file
    return Percentile(values, share);
  };
  std::vector<double> distances, shares;
  int64_t on_moving_part = 0;
  auto objects = nlohmann::json::array();
  for (const KeyPointScore& score : scores) {
    distances.insert(distances.end(), score.distances.begin(), score.distances.end());
    objects.push_back(score.object.empty() ? nlohmann::json() : nlohmann::json(score.object));
    if (score.object.empty()) continue;
    ++on_moving_part;
    for (const double distance : score.distances) {
      if (score.motion_range > 0) shares.push_back(distance / score.motion_range);
    }
  }
  json["key_points.on_moving_part"] = on_moving_part;
  json["key_points.objects"] = std::move(objects);
  json["key_points.error"] = quantile(distances, 0.5);
  json["key_points.error_share"] = quantile(shares, 0.5);
  json["key_points.error_share_95"] = quantile(shares, 0.95);
  return json;
}

}  // namespace editnerf
