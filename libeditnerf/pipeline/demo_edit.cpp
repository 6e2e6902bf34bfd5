#include "libeditnerf/pipeline/demo_edit.h"

#include <torch/types.h>
#include <torch/utils.h>

#include <algorithm>
#include <cmath>
#include <optional>
#include <tuple>
#include <vector>

#include "libeditnerf/base/error.h"
#include "libeditnerf/base/shape.h"

namespace editnerf {
namespace {

constexpr double kPi = 3.14159265358979323846;
constexpr double kFadeShare = 0.15;  // of a sweep, at either end

// Smoothed positions in the order of their places along the first principal component.
struct Way {
  torch::Tensor points;       // [T, D] float64
  std::vector<double> place;  // never decreasing

  double begin() const { return place.front(); }
  double length() const { return place.back() - place.front(); }

  torch::Tensor At(double wanted) const {
    const auto after = std::lower_bound(place.begin(), place.end(), wanted);
    if (after == place.begin()) return points[0];
    if (after == place.end()) return points[-1];
    const int64_t i = after - place.begin();
    const double low = place[static_cast<size_t>(i - 1)], high = place[static_cast<size_t>(i)];
    return torch::lerp(points[i - 1], points[i], (wanted - low) / (high - low));
  }
};

// Windows shrink towards the ends and stay centred, so that the extremes are kept and the order as well.
torch::Tensor Smoothed(const torch::Tensor& rows) {
  const int64_t count = rows.size(0), reach = std::max<int64_t>(1, count / 20);
  auto smooth = torch::empty_like(rows);
  for (int64_t i = 0; i < count; ++i) {
    const int64_t half = std::min({reach, i, count - 1 - i});
    smooth[i] = rows.slice(0, i - half, i + half + 1).mean(0);
  }
  return smooth;
}

Way MakeWay(const torch::Tensor& track) {
  const auto centered = track - track.mean(0);
  // Eigenvectors come with any sign: the one along the largest component is taken.
  const auto axis = std::get<1>(at::linalg_eigh(centered.t().matmul(centered))).select(1, -1);
  const auto largest = axis[axis.abs().argmax()];
  const auto place = centered.matmul(largest.item<double>() < 0 ? -axis : axis);
  const auto order = std::get<1>(place.sort(/*stable=*/true, /*dim=*/0, /*descending=*/false));
  Way way;
  way.points = Smoothed(track.index_select(0, order));
  const auto sorted = Smoothed(place.index_select(0, order).unsqueeze(1));
  for (int64_t i = 0; i < sorted.size(0); ++i) {
    const double next = sorted[i][0].item<double>();
    way.place.push_back(way.place.empty() ? next : std::max(next, way.place.back()));  // in spite of rounding
  }
  return way;
}

// 0 at the sweep's ends, 1 between them.
double FadeIn(double share) {
  const double x = std::clamp(std::min(share, 1 - share) / kFadeShare, 0.0, 1.0);
  return x * x * (3 - 2 * x);
}

std::optional<Vec3> AsPosition(const torch::Tensor& row) {
  return Vec3{row[0].item<double>(), row[1].item<double>(), row[2].item<double>()};
}

// Key points [T, N, 3] whose ways resemble each other lie on one part, or on parts that move as one: moved one without
// the other they would show a state that is like none in the clip. Lists of key points, in the order of their first.
std::vector<std::vector<int64_t>> GroupsOf(const torch::Tensor& tracks) {
  constexpr double kLeastCorrelation = 0.5;
  const auto centered = (tracks - tracks.mean(0)).transpose(0, 1).flatten(1);  // [N, 3 T]
  const auto unit = centered / centered.norm(2, 1, true).clamp_min(1e-12);
  const auto correlation = unit.matmul(unit.t());
  std::vector<std::vector<int64_t>> groups;
  for (int64_t n = 0; n < tracks.size(1); ++n) {
    const auto own = std::find_if(groups.begin(), groups.end(), [&](const std::vector<int64_t>& group) {
      return correlation[n][group.front()].item<double>() >= kLeastCorrelation;
    });
    if (own != groups.end()) {
      own->push_back(n);
    } else {
      groups.push_back({n});
    }
  }
  return groups;
}

void AddSweeps(const torch::Tensor& tracks, const EditFrame& resting, int64_t rest_row, int64_t count, EditFile& edit) {
  const std::vector<std::vector<int64_t>> groups = GroupsOf(tracks);
  const auto sweep = [&](const std::vector<int64_t>& group, double phase) {  // [count, 3 n]
    const auto own = tracks.index_select(1, torch::tensor(group, torch::kInt64)).flatten(1);
    return SweepAlong(own, own[rest_row], count, phase);
  };
  const auto put = [&](const std::vector<int64_t>& group, const torch::Tensor& row, EditFrame& frame) {
    for (size_t k = 0; k < group.size(); ++k) {
      const auto n = static_cast<size_t>(group[k]);
      if (frame.key_points.size() <= n) frame.key_points.resize(n + 1);
      const auto first = static_cast<int64_t>(3 * k);
      frame.key_points[n] = AsPosition(row.slice(0, first, first + 3));
    }
  };
  for (const auto& group : groups) {
    const auto way = sweep(group, 0);
    for (int64_t i = 0; i < count; ++i) {
      EditFrame frame = resting;
      put(group, way[i], frame);
      edit.frames.push_back(frame);
    }
  }
  if (groups.size() < 2) return;
  std::vector<torch::Tensor> ways;
  for (size_t g = 0; g < groups.size(); ++g) {
    ways.push_back(sweep(groups[g], static_cast<double>(g) / static_cast<double>(groups.size())));
  }
  for (int64_t i = 0; i < count; ++i) {
    EditFrame frame = resting;
    for (size_t g = 0; g < groups.size(); ++g) put(groups[g], ways[g][i], frame);
    edit.frames.push_back(frame);
  }
}

// Two sweeps' worth of frames, the ends once each.
void AddCameraTour(const Scene& scene, const EditFrame& resting, int64_t count, EditFile& edit) {
  const auto last = static_cast<double>(scene.train.size() - 1);
  for (int64_t i = 0; i < 2 * count; ++i) {
    const double share = static_cast<double>(i) / static_cast<double>(count);
    const auto row = static_cast<size_t>(std::lround(last * (1 - std::abs(1 - share))));
    EditFrame frame = resting;
    frame.camera_frame = scene.frames[static_cast<size_t>(scene.train[row])].id;
    edit.frames.push_back(frame);
  }
}

}  // namespace

torch::Tensor SweepAlong(const torch::Tensor& track, const torch::Tensor& rest, int64_t count, double phase) {
  CheckShape(track, {kAny, kAny}, "key point track");
  CheckShape(rest, {track.size(1)}, "resting key point");
  if (track.size(0) < 1 || count < 1) {
    Throw<ShapeError>("sweep: expected at least one position and one step, found {} and {}", track.size(0), count);
  }
  const torch::NoGradGuard no_grad;
  const auto known = track.detach().to(torch::kCPU, torch::kFloat64);
  const auto start = rest.detach().to(torch::kCPU, torch::kFloat64);
  const Way way = MakeWay(known);
  const auto nearest = static_cast<size_t>((way.points - start).square().sum(1).argmin().item<int64_t>());
  const double at_rest = way.length() > 0 ? (way.place[nearest] - way.begin()) / way.length() : 0;
  const double first_angle = std::acos(std::clamp(1 - 2 * at_rest, -1.0, 1.0)) + 2 * kPi * phase;
  std::vector<torch::Tensor> steps;
  for (int64_t i = 0; i < count; ++i) {
    const double share = count > 1 ? static_cast<double>(i) / static_cast<double>(count - 1) : 0;
    const double along = 0.5 - 0.5 * std::cos(first_angle + 2 * kPi * share);
    steps.push_back(torch::lerp(start, way.At(way.begin() + along * way.length()), FadeIn(share)));
  }
  return torch::stack(steps);
}

EditFile MakeDemoEdit(const Run& run, int64_t frames_per_sweep) {
  if (run.stage == FieldStage::kPretrain) {
    Throw<DataError>("demo edit: this is a pretrained run, which has no key points; give the run of enf-train");
  }
  if (frames_per_sweep < 2) {
    Throw<ConfigError>("demo edit: expected at least 2 frames for each sweep, found {}", frames_per_sweep);
  }
  const torch::NoGradGuard no_grad;
  const auto num_frames = static_cast<int64_t>(run.scene.train.size()), middle = num_frames / 2;
  EditFrame resting;
  resting.camera_frame = run.scene.frames[static_cast<size_t>(run.scene.train[static_cast<size_t>(middle)])].id;
  resting.code_frame = resting.camera_frame;
  EditFile edit;
  if (run.field->num_key_points() == 0) {
    AddCameraTour(run.scene, resting, frames_per_sweep, edit);
  } else {
    const auto all = torch::arange(num_frames, torch::TensorOptions(torch::kInt64).device(run.device));
    AddSweeps(run.field->States(all).key_points.to(torch::kCPU), resting, middle, frames_per_sweep, edit);
  }
  return edit;
}

}  // namespace editnerf
