#include "libeditnerf/evaluation/protocols.h"

#include <torch/types.h>
#include <torch/utils.h>

#include <cmath>

#include "libeditnerf/base/error.h"
#include "libeditnerf/base/shape.h"

namespace editnerf {
namespace {

const GroundTruth& Truth(const Scene& scene) {
  if (!scene.truth) {
    Throw<DataError>("{}: no ground truth (gt/), which the editing protocol needs; only synthetic scenes have it",
                     scene.name);
  }
  return *scene.truth;
}

void CheckFrame(const Scene& scene, int64_t frame) {
  if (frame < 0 || frame >= static_cast<int64_t>(scene.frames.size())) {
    Throw<DataError>("{}: no frame {}, there are {}", scene.name, frame, scene.frames.size());
  }
}

}  // namespace

bool HasMasks(const Scene& scene) { return scene.truth && scene.truth->mask.defined(); }

int64_t ObjectAt(const Scene& scene, int64_t frame, const Vec3& position) {
  const GroundTruth& truth = Truth(scene);
  CheckFrame(scene, frame);
  const Projected pixel = Project(scene.frames[static_cast<size_t>(frame)].camera, position);
  if (!pixel.valid) return kStaticObject;
  const double u = std::floor(pixel.u), v = std::floor(pixel.v);
  // Written so that a NaN is outside.
  const bool inside =
      u >= 0 && v >= 0 && u < static_cast<double>(scene.width()) && v < static_cast<double>(scene.height());
  if (!inside) return kStaticObject;
  const auto object = truth.mask[frame][static_cast<int64_t>(v)][static_cast<int64_t>(u)].item<int64_t>() - 1;
  if (object >= static_cast<int64_t>(truth.objects.size())) {
    Throw<DataError>("{}: gt/mask of frame {} holds {}, but gt/motion.json names {} objects", scene.name,
                     scene.frames[static_cast<size_t>(frame)].id, object + 1, truth.objects.size());
  }
  return object;
}

std::vector<ReferenceKeyPoint> WithObjects(const Scene& scene, const torch::Tensor& positions,
                                           const std::vector<int64_t>& frames) {
  CheckShape(positions, {static_cast<int64_t>(frames.size()), 3}, "key point positions");
  const auto rows = positions.to(torch::kCPU, torch::kFloat64).contiguous();
  const auto values = rows.accessor<double, 2>();
  std::vector<ReferenceKeyPoint> key_points;
  for (size_t i = 0; i < frames.size(); ++i) {
    const auto row = values[static_cast<int64_t>(i)];
    const Vec3 position = {row[0], row[1], row[2]};
    key_points.push_back({position, frames[i], ObjectAt(scene, frames[i], position)});
  }
  return key_points;
}

torch::Tensor TrueKeyPoints(const Scene& scene, const std::vector<ReferenceKeyPoint>& key_points, int64_t frame) {
  CheckFrame(scene, frame);
  auto positions = torch::empty({static_cast<int64_t>(key_points.size()), 3}, torch::kFloat64);
  for (size_t i = 0; i < key_points.size(); ++i) {
    const ReferenceKeyPoint& key_point = key_points[i];
    auto position =
        torch::tensor({key_point.position.x, key_point.position.y, key_point.position.z, 1.0}, torch::kFloat64);
    if (key_point.object != kStaticObject) {
      CheckFrame(scene, key_point.frame);
      const auto& motion = Truth(scene).scene_from_object;
      if (key_point.object < 0 || key_point.object >= motion.size(1)) {
        Throw<DataError>("{}: no object {}, there are {}", scene.name, key_point.object, motion.size(1));
      }
      const auto in_object = torch::mv(torch::linalg_inv(motion[key_point.frame][key_point.object]), position);
      position = torch::mv(motion[frame][key_point.object], in_object);
    }
    positions[static_cast<int64_t>(i)] = position.slice(0, 0, 3);
  }
  return positions;
}

NearestFrame NearestTrainingFrame(const torch::Tensor& tracks, const torch::Tensor& key_points) {
  CheckShape(tracks, {kAny, kAny, 3}, "key point tracks");
  CheckShape(key_points, {tracks.size(1), 3}, "key points");
  if (tracks.numel() == 0)
    Throw<ShapeError>("key point tracks: expected a frame and a key point, found {}", ShapeString(tracks));
  torch::NoGradGuard no_grad;
  const auto offsets = tracks.to(torch::kCPU, torch::kFloat64) - key_points.to(torch::kCPU, torch::kFloat64);
  const auto distances = offsets.square().sum(2).mean(1).sqrt().contiguous();
  const double* values = distances.data_ptr<double>();
  NearestFrame nearest = {0, values[0]};
  for (int64_t t = 1; t < distances.numel(); ++t) {
    if (values[t] < nearest.distance) nearest = {t, values[t]};
  }
  return nearest;
}

}  // namespace editnerf
