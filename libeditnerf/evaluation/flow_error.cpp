#include "libeditnerf/evaluation/flow_error.h"

#include <torch/types.h>

#include <algorithm>
#include <cmath>
#include <limits>

#include "libeditnerf/base/error.h"
#include "libeditnerf/base/shape.h"
#include "libeditnerf/geometry/camera.h"

namespace editnerf {
namespace {

constexpr double kSameDepth = 0.02;  // of the distance
constexpr double kSamePose = 1e-6;   // largest entry of a transform's change, scene units

// Columns of a row-major 4 x 4 transform applied to a point.
Vec3 Transformed(const double* m, const Vec3& p) {
  return {m[0] * p.x + m[1] * p.y + m[2] * p.z + m[3], m[4] * p.x + m[5] * p.y + m[6] * p.z + m[7],
          m[8] * p.x + m[9] * p.y + m[10] * p.z + m[11]};
}

// One frame's truth, as arrays.
struct TruthMaps {
  TruthMaps(const Scene& scene, int64_t frame)
      : depth_map(scene.truth->depth[frame].to(torch::kFloat32).contiguous()),
        mask_map(scene.truth->mask[frame].contiguous()),
        depth(depth_map.data_ptr<float>()),
        mask(mask_map.data_ptr<uint8_t>()),
        height(scene.height()),
        width(scene.width()) {}

  // Whether one of the four pixels around a position shows this object at this distance.
  bool Shows(uint8_t object, double distance, double u, double v) const {
    const auto column = static_cast<int64_t>(std::floor(u - 0.5)), row = static_cast<int64_t>(std::floor(v - 0.5));
    for (int64_t r = std::max<int64_t>(row, 0); r <= std::min(row + 1, height - 1); ++r) {
      for (int64_t c = std::max<int64_t>(column, 0); c <= std::min(column + 1, width - 1); ++c) {
        const int64_t i = r * width + c;
        if (mask[i] == object && std::abs(depth[i] - distance) <= kSameDepth * distance) return true;
      }
    }
    return false;
  }

  torch::Tensor depth_map, mask_map;
  const float* depth;
  const uint8_t* mask;
  int64_t height, width;
};

torch::Tensor NearEdge(const torch::Tensor& mask, int64_t edge) {
  const torch::Tensor map = mask.to(torch::kFloat32).unsqueeze(0).unsqueeze(0);
  const auto largest = [&](const torch::Tensor& x) { return torch::max_pool2d(x, 2 * edge + 1, 1, edge); };
  return (largest(map) != -largest(-map))[0][0];
}

}  // namespace

TrueFlow ComputeTrueFlow(const Scene& scene, int64_t from, int64_t to) {
  if (!scene.truth) Throw<DataError>("scene '{}': true flow takes ground truth, and it has none", scene.name);
  const TruthMaps here(scene, from), there(scene, to);
  const Camera &first = scene.frames[static_cast<size_t>(from)].camera,
               &second = scene.frames[static_cast<size_t>(to)].camera;
  const torch::Tensor pose_from = scene.truth->scene_from_object[from], pose_to = scene.truth->scene_from_object[to];
  const torch::Tensor change = torch::matmul(pose_to, torch::inverse(pose_from)).contiguous();  // [O, 4, 4]
  const torch::Tensor moved = (pose_to - pose_from).abs().amax({1, 2}) > kSamePose;
  TrueFlow truth;
  truth.flow = torch::full({here.height, here.width, 2}, std::numeric_limits<float>::quiet_NaN());
  truth.visible = torch::zeros({here.height, here.width}, torch::kBool);
  truth.moving = torch::zeros({here.height, here.width}, torch::kBool);
  float* flow = truth.flow.data_ptr<float>();
  for (int64_t i = 0; i < here.height * here.width; ++i) {
    if (!std::isfinite(here.depth[i])) continue;
    const int64_t row = i / here.width, column = i % here.width;
    const double u = static_cast<double>(column) + 0.5, v = static_cast<double>(row) + 0.5;
    const int64_t object = static_cast<int64_t>(here.mask[i]) - 1;
    Vec3 point = first.position + first.DirectionThrough(u, v) * here.depth[i];
    if (object >= 0) {
      point = Transformed(change.data_ptr<double>() + 16 * object, point);
      truth.moving.data_ptr<bool>()[i] = moved.data_ptr<bool>()[object];
    }
    const Projected place = Project(second, point);
    if (!place.valid) continue;
    flow[2 * i] = static_cast<float>(place.u - u);
    flow[2 * i + 1] = static_cast<float>(place.v - v);
    const bool inside = place.u >= 0 && place.v >= 0 && place.u < static_cast<double>(here.width) &&
                        place.v < static_cast<double>(here.height);
    truth.visible.data_ptr<bool>()[i] =
        inside && there.Shows(here.mask[i], Norm(point - second.position), place.u, place.v);
  }
  return truth;
}

void FlowErrors::Add(const torch::Tensor& flow, const Scene& scene, int64_t from, int64_t to) {
  CheckShape(flow, {scene.height(), scene.width(), 2}, "flow");
  const TrueFlow truth = ComputeTrueFlow(scene, from, to);
  const torch::Tensor error =
      (flow.to(torch::kFloat32) - truth.flow).norm(2, 2).nan_to_num(std::numeric_limits<double>::infinity());
  const torch::Tensor near_edge = NearEdge(scene.truth->mask[from], edge_);
  for (size_t part = 0; part < errors_.size(); ++part) {
    const bool moving = part >= 2, edge = part % 2 == 1;
    const torch::Tensor own = truth.visible.logical_and(truth.moving == moving).logical_and(near_edge == edge);
    errors_[part].push_back(error.masked_select(own));
  }
}

std::vector<FlowError> FlowErrors::Summary() const {
  std::vector<FlowError> summary;
  for (size_t part = 0; part < errors_.size(); ++part) {
    if (errors_[part].empty()) continue;
    const torch::Tensor sorted = std::get<0>(torch::cat(errors_[part]).sort());
    const int64_t pixels = sorted.size(0);
    if (pixels == 0) continue;
    const auto at = [&](double share) {
      return sorted[static_cast<int64_t>(share * static_cast<double>(pixels - 1))].item<double>();
    };
    summary.push_back({static_cast<FlowPart>(part), at(0.5), at(0.9), pixels});
  }
  return summary;
}

}  // namespace editnerf
