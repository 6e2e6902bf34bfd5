#include "libeditnerf/pipeline/demo_edit.h"

#include <torch/torch.h>

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
  torch::Tensor points;       // [T, 3] float64
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
  const auto axis = std::get<1>(at::linalg_eigh(centered.t().matmul(centered))).select(1, 2);
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

void AddSweeps(const torch::Tensor& tracks, const EditFrame& resting, int64_t rest_row, int64_t count, EditFile& edit) {
  const int64_t num_key_points = tracks.size(1);
  const auto sweep = [&](int64_t n, double phase) {
    return SweepAlong(tracks.select(1, n), tracks[rest_row][n], count, phase);
  };
  for (int64_t n = 0; n < num_key_points; ++n) {
    const auto way = sweep(n, 0);
    for (int64_t i = 0; i < count; ++i) {
      EditFrame frame = resting;
      frame.key_points.resize(static_cast<size_t>(n + 1));
      frame.key_points.back() = AsPosition(way[i]);
      edit.frames.push_back(frame);
    }
  }
  if (num_key_points < 2) return;
  std::vector<torch::Tensor> ways;
  for (int64_t n = 0; n < num_key_points; ++n) {
    ways.push_back(sweep(n, static_cast<double>(n) / static_cast<double>(num_key_points)));
  }
  for (int64_t i = 0; i < count; ++i) {
    EditFrame frame = resting;
    for (const auto& way : ways) frame.key_points.push_back(AsPosition(way[i]));
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
  CheckShape(track, {kAny, 3}, "key point track");
  CheckShape(rest, {3}, "resting key point");
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
