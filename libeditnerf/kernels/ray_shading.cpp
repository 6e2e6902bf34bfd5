#include "libeditnerf/kernels/ray_shading.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "libeditnerf/base/phase_clock.h"
#include "libeditnerf/kernels/harmonics.h"
#include "libeditnerf/kernels/tile_functions.h"
#include "libeditnerf/kernels/tile_layout.h"

namespace editnerf {

void RayLossSums::Add(const RayLossSums& other) {
  reconstruction += other.reconstruction;
  distortion += other.distortion;
  ambient += other.ambient;
  depth += other.depth;
  samples += other.samples;
  returned += other.returned;
}

void RayShading::Resize(int64_t samples) {
  const auto size = static_cast<size_t>(PaddedSamples(samples));
  if (t_.size() >= size) return;
  for (auto* values : {&t_, &density_, &tau_, &before_, &light_, &weight_, &rgb_[0], &rgb_[1], &rgb_[2], &to_weight_,
                       &to_density_, &pull_, &chosen_, &shown_}) {
    values->resize(size);
  }
}

void RayShading::FindHarmonics(const FieldKernel& field, const BundledRays& rays, const RayBundle& bundle) {
  if (!field.field().use_direction) return;
  harmonics_.resize(static_cast<size_t>(bundle.num_rays() * kNumHarmonics));
  for (int64_t r = 0; r < bundle.num_rays(); ++r) {
    const float* const d = rays.direction + 3 * bundle.Ray(r);
    const auto values = Harmonics<double>(d[0], d[1], d[2], 1.0);
    std::copy(values.begin(), values.end(), harmonics_.begin() + r * kNumHarmonics);
  }
}

// Given the slots and the density network's output.
void RayShading::ColorTile(const FieldKernel& field, const BundledRays& rays, const RayBundle& bundle, int64_t count,
                           bool for_gradients, TileMemory& tile, int32_t* state) const {
  const FieldRows& rows = field.rows();
  const float* const slots = tile.Row(rows.slot);
  for (int64_t s = 0; s < count; ++s) {
    const auto slot = static_cast<int64_t>(slots[s]);
    state[s] = static_cast<int32_t>(rays.state[bundle.Ray(slot)]);
    if (!field.field().use_direction) continue;
    float* const column = tile.Row(rows.harmonics) + s;
    for (int64_t k = 0; k < kNumHarmonics; ++k) {
      column[k * kTileStride] = harmonics_[static_cast<size_t>(slot * kNumHarmonics + k)];
    }
  }
  field.Color(state, count, for_gradients, tile);
}

void RayShading::Color(const FieldKernel& field, const BundledRays& rays, RayBundle& bundle) {
  FindHarmonics(field, rays, bundle);
  for (int64_t i = 0; i < bundle.num_tiles(); ++i) {
    RayBundle::Tile& tile = bundle.tile(i);
    ColorTile(field, rays, bundle, tile.count, /*for_gradients=*/true, tile.memory, tile.state);
  }
}

// shown_ of every sample, and in the tiles' row `chosen` which are to be coloured. Of each ray those are left out that
// have less weight than their share of what may be left out in all; what is shown is made up to the ray's whole weight.
int64_t RayShading::ChooseSeen(double color_error, RayBundle& bundle) {
  int64_t chosen = 0;
  for (size_t r = 0; r + 1 < bundle.offsets().size(); ++r) {
    const auto begin = static_cast<size_t>(bundle.offsets()[r]), end = static_cast<size_t>(bundle.offsets()[r + 1]);
    double all = 0, kept = 0;
    for (size_t s = begin; s < end; ++s) all += weight_[s];
    const double least = color_error * all / static_cast<double>(std::max<size_t>(end - begin, 1));
    for (size_t s = begin; s < end; ++s) {
      const bool keep = color_error == 0 || weight_[s] > least;
      shown_[s] = keep ? weight_[s] : 0.0F;
      kept += shown_[s];
      chosen += static_cast<int64_t>(keep);
    }
    const auto made_up = static_cast<float>(kept > 0 ? all / kept : 0);
    for (size_t s = begin; s < end; ++s) shown_[s] *= made_up;
  }
  return chosen;
}

// Colours of the samples that count, side by side in tiles of their own, and from there back into the bundle's.
int64_t RayShading::ColorSeen(const FieldKernel& field, const BundledRays& rays, double color_error,
                              RayBundle& bundle) {
  const FieldRows& rows = field.rows();
  const int64_t chosen = ChooseSeen(color_error, bundle);
  bundle.Scatter(shown_.data(), rows.chosen);
  FindHarmonics(field, rays, bundle);
  if (seen_ == nullptr) {
    const int64_t outputs = field.field().density.weights.back().size(0);
    const int64_t axes = rows.shade_features > 0 ? 3 : 0;
    seen_ = std::make_unique<PackedTiles>(
        rows.count, std::vector<RowRange>{{rows.slot, 1}, {rows.x, axes}, {rows.density_out, outputs}});
  }
  int32_t state[kTileStride] = {};
  const auto evaluate = [&] {
    const int64_t count = seen_->count();
    ColorTile(field, rays, bundle, count, /*for_gradients=*/false, seen_->tile(), state);
    for (int c = 0; c < 3; ++c) {
      const float* const color = seen_->tile().Row(rows.color + c);
      for (int64_t s = 0; s < count; ++s) {
        const int32_t sample = seen_samples_[static_cast<size_t>(s)];
        bundle.tile(sample / kTile).memory.Row(rows.color + c)[sample % kTile] = color[s];
      }
    }
    seen_samples_.erase(seen_samples_.begin(), seen_samples_.begin() + count);
    seen_->Next();
  };
  seen_samples_.clear();
  seen_->Clear();
  for (int64_t i = 0; i < bundle.num_tiles(); ++i) {
    RayBundle::Tile& tile = bundle.tile(i);
    const float* const keep = tile.memory.Row(rows.chosen);
    for (int64_t s = 0; s < tile.count; ++s) {
      if (keep[s] > 0) seen_samples_.push_back(static_cast<int32_t>(i * kTile + s));
    }
    seen_->Append(keep, tile.memory, tile.count);
    if (seen_->full()) evaluate();
  }
  if (seen_->count() > 0) evaluate();
  return chosen;
}

// Light and weights of all samples, in the order of the rays.
void RayShading::Composite(const FieldRows& rows, const BundledRays& rays, RayBundle& bundle) {
  Resize(bundle.num_samples());
  bundle.Gather(rows.t, t_.data());
  bundle.Gather(rows.density, density_.data());
  for (int64_t r = 0; r < bundle.num_rays(); ++r) {
    double thickness = 0;
    for (auto s = static_cast<size_t>(bundle.offsets()[static_cast<size_t>(r)]);
         s < static_cast<size_t>(bundle.offsets()[static_cast<size_t>(r) + 1]); ++s) {
      const double tau = static_cast<double>(density_[s]) * static_cast<double>(rays.delta);
      before_[s] = static_cast<float>(thickness);
      tau_[s] = static_cast<float>(tau);
      thickness += tau;
    }
  }
  LightAlongRays(tau_.data(), before_.data(), bundle.num_samples(), light_.data(), weight_.data());
}

void RayShading::GatherColors(const FieldRows& rows, RayBundle& bundle) {
  for (int c = 0; c < 3; ++c) bundle.Gather(rows.color + c, rgb_[c].data());
}

float RayShading::FrontOf(const BundledRays& rays, int64_t ray, Samples samples) const {
  static const double thick = -std::log1p(-kFrontShare);
  const auto begin = static_cast<size_t>(samples.begin), end = static_cast<size_t>(samples.end);
  for (size_t s = begin; s < end; ++s) {
    if (static_cast<double>(before_[s]) + tau_[s] < thick) continue;
    const int64_t first = rays.FirstSample(ray);
    const float behind_first = rays.steps.Position(first, rays.jitter[ray]) + rays.steps.step / 2;
    return s == begin && first > 0 && t_[s] < behind_first ? -1.0F : t_[s];
  }
  return std::numeric_limits<float>::infinity();
}

int64_t RayShading::SurfaceOf(Samples samples) const {
  double sum = 0;
  int64_t s = samples.begin;
  // Rounded as the sum of packed_compositing.cpp.
  while (s < samples.end && static_cast<float>(sum += weight_[static_cast<size_t>(s)]) < 0.5F) ++s;
  return s;
}

// The distortion of a ray; to_weight_ = factor times its gradient.
double RayShading::Distort(Samples samples, double factor) {
  const auto begin = static_cast<size_t>(samples.begin), end = static_cast<size_t>(samples.end);
  const double length = delta_ / 3;
  double signed_weight = 0, signed_moment = 0, loss = 0;
  for (size_t s = begin; s < end; ++s) {
    signed_weight -= weight_[s];
    signed_moment -= weight_[s] * (static_cast<double>(t_[s]) - t_[begin]);
  }
  // sum_j w_j |x_i - x_j| = x_i (before - behind) + (moment behind - moment before); the signed sums are kept.
  for (size_t s = begin; s < end; ++s) {
    const double w = weight_[s], x = static_cast<double>(t_[s]) - t_[begin];
    signed_weight += w;
    signed_moment += w * x;
    const double reach = x * signed_weight - signed_moment;
    loss += w * (reach + w * length);
    to_weight_[s] = static_cast<float>(factor * 2 * (reach + w * length));
    signed_weight += w;
    signed_moment += w * x;
  }
  return loss;
}

// How far a ray's light lies from a known distance; to_weight_ gets factor times its gradient added.
double RayShading::MissDepth(Samples samples, double distance, double tolerance, double factor) {
  double loss = 0;
  for (auto s = static_cast<size_t>(samples.begin); s < static_cast<size_t>(samples.end); ++s) {
    const double miss = std::max(0.0, std::abs(t_[s] / distance - 1) - tolerance);
    loss += weight_[s] * miss;
    to_weight_[s] += static_cast<float>(factor * miss);
  }
  return loss;
}

// Which samples of a ray go back, `chosen_`, and what is then made up for the others; returns how many. They are drawn
// evenly along the ray, whenever the sum of their chances passes another whole number: a ray that several samples share
// a small gradient of sends one of them, not none or all.
int64_t RayShading::Choose(Samples samples, double least, float jitter) {
  double ignored = 0, chances = std::modf(4096.0 * static_cast<double>(jitter), &ignored);
  int64_t count = 0;
  for (auto s = static_cast<size_t>(samples.begin); s < static_cast<size_t>(samples.end); ++s) {
    const double size = std::abs(static_cast<double>(to_density_[s])) + std::abs(rgb_[0][s]) + std::abs(rgb_[1][s]) +
                        std::abs(rgb_[2][s]);
    chosen_[s] = 1;
    if (size < least && pull_[s] == 0) {  // false for NaN, which has to be seen
      const double before = std::floor(chances), chance = size / least;
      chances += chance;
      chosen_[s] = std::floor(chances) > before ? 1.0F : 0.0F;
      const auto made_up = static_cast<float>(chosen_[s] / std::max(chance, 1e-30));
      for (float* gradient : {&to_density_[s], &rgb_[0][s], &rgb_[1][s], &rgb_[2][s]}) *gradient *= made_up;
    }
    count += static_cast<int64_t>(chosen_[s]);
  }
  return count;
}

void RayShading::Train(const FieldKernel& field, const BundledRays& rays, const RayLoss& loss, RayBundle& bundle,
                       RayLossSums* sums) {
  const FieldRows& rows = field.rows();
  Color(field, rays, bundle);
  const ThreadPhase phase(Phase::kCompositing);
  Composite(rows, rays, bundle);
  GatherColors(rows, bundle);
  delta_ = rays.delta;
  std::fill_n(pull_.begin(), bundle.num_samples(), 0.0F);
  const double per_ray = 1 / static_cast<double>(rays.count);
  surfaces_.clear();
  for (int64_t r = 0; r < bundle.num_rays(); ++r) {
    const int64_t ray = bundle.Ray(r);
    const Samples samples = {bundle.offsets()[static_cast<size_t>(r)], bundle.offsets()[static_cast<size_t>(r) + 1]};
    const auto begin = static_cast<size_t>(samples.begin), end = static_cast<size_t>(samples.end);
    double rgb[3] = {}, g_rgb[3], end_light = 0, missed = 0;
    const double emphasis = loss.emphasis != nullptr ? loss.emphasis[ray] : 1.0;
    for (size_t s = begin; s < end; ++s) {
      for (int c = 0; c < 3; ++c) rgb[c] += static_cast<double>(weight_[s]) * rgb_[c][s];
    }
    const double passing = end > begin ? static_cast<double>(light_[end - 1]) * std::exp(-tau_[end - 1]) : 1.0;
    for (int c = 0; c < 3; ++c) {
      const double behind = loss.background != nullptr ? loss.background[3 * ray + c] : 0;
      const double error = rgb[c] + passing * behind - loss.target[3 * ray + c];
      missed += error * error / 3;
      g_rgb[c] = 2 * error * emphasis * per_ray / 3;
      end_light -= g_rgb[c] * behind * passing;
    }
    sums->reconstruction += emphasis * missed;
    if (loss.missed != nullptr) loss.missed[ray] = static_cast<float>(missed);
    if (loss.distortion > 0) {
      sums->distortion += loss.distortion * Distort(samples, loss.distortion * per_ray);
    } else {
      std::fill(to_weight_.begin() + samples.begin, to_weight_.begin() + samples.end, 0.0F);
    }
    if (loss.depth > 0 && loss.distance != nullptr && std::isfinite(loss.distance[ray])) {
      sums->depth += loss.depth * MissDepth(samples, loss.distance[ray], loss.tolerance[ray], loss.depth * per_ray);
    }
    if (loss.ambient > 0) {
      const int64_t surface = SurfaceOf(samples);
      if (surface < samples.end) {
        pull_[static_cast<size_t>(surface)] = static_cast<float>(2 * loss.ambient * per_ray);
        surfaces_.push_back(surface);
      }
    }
    // As CompositePacked's backward pass has it, with the activations' derivatives.
    double later = 0;
    for (size_t s = end; s-- > begin;) {
      const double w = weight_[s];
      const double g = to_weight_[s] + g_rgb[0] * rgb_[0][s] + g_rgb[1] * rgb_[1][s] + g_rgb[2] * rgb_[2][s];
      // Behind an opaque sample nothing is left of the difference; there the next sample has the light.
      double behind = light_[s] - w;
      if (2 * behind < light_[s]) behind = s + 1 < end ? light_[s + 1] : passing;
      const double to_tau = g * behind - later + end_light;
      to_density_[s] = static_cast<float>(to_tau * tau_[s]);
      later += g * w;
      for (int c = 0; c < 3; ++c) {
        const double value = rgb_[c][s];
        rgb_[c][s] = static_cast<float>(w * g_rgb[c] * value * (1 - value));
      }
    }
    sums->returned += Choose(samples, loss.roulette * per_ray, rays.jitter[ray]);
  }
  for (const int64_t surface : surfaces_) {
    const int32_t sample = bundle.order()[static_cast<size_t>(surface)];
    const TileMemory& tile = bundle.tile(sample / kTile).memory;
    for (int64_t a = 0; a < field.field().ambient_dim; ++a) {
      const double value = tile.Row(rows.ambient + a)[sample % kTile];
      sums->ambient += loss.ambient * value * value;
    }
  }
  sums->samples += bundle.num_samples();
  for (int c = 0; c < 3; ++c) bundle.Scatter(rgb_[c].data(), rows.grad_color + c);
  bundle.Scatter(to_density_.data(), rows.grad_density_out);
  bundle.Scatter(pull_.data(), rows.pull);
  bundle.Scatter(chosen_.data(), rows.chosen);
}

int64_t RayShading::Show(const FieldKernel& field, const BundledRays& rays, const RayPicture& picture,
                         RayBundle& bundle) {
  const FieldRows& rows = field.rows();
  const bool with_color = picture.rgb != nullptr;
  int64_t colored = 0;
  Composite(rows, rays, bundle);
  if (with_color) {
    colored = ColorSeen(field, rays, picture.color_error, bundle);
    GatherColors(rows, bundle);
  }
  const ThreadPhase phase(Phase::kCompositing);
  for (int64_t r = 0; r < bundle.num_rays(); ++r) {
    const int64_t ray = bundle.Ray(r);
    const Samples samples = {bundle.offsets()[static_cast<size_t>(r)], bundle.offsets()[static_cast<size_t>(r) + 1]};
    const auto begin = static_cast<size_t>(samples.begin), end = static_cast<size_t>(samples.end);
    const double thickness = end > begin ? static_cast<double>(before_[end - 1]) + tau_[end - 1] : 0.0;
    for (int c = 0; with_color && c < 3; ++c) {
      double sum = 0;
      for (size_t s = begin; s < end; ++s) {
        if (shown_[s] > 0) sum += static_cast<double>(shown_[s]) * rgb_[c][s];
      }
      if (picture.background != nullptr) {
        sum += std::exp(-thickness) * picture.background[3 * ray + c];
      }
      picture.rgb[3 * ray + c] = static_cast<float>(sum);
    }
    if (picture.front != nullptr) picture.front[ray] = FrontOf(rays, ray, samples);
    const int64_t surface = SurfaceOf(samples);
    const bool found = surface < samples.end;
    picture.opacity[ray] = static_cast<float>(-std::expm1(-thickness));
    picture.depth_valid[ray] = found;
    picture.depth[ray] = found ? t_[static_cast<size_t>(surface)] : std::numeric_limits<float>::quiet_NaN();
    const auto copy = [&](int64_t row, int64_t width, float* to) {
      if (to == nullptr) return;
      if (!found) return void(std::fill_n(to + ray * width, width, 0.0F));
      const int32_t sample = bundle.order()[static_cast<size_t>(surface)];
      const TileMemory& tile = bundle.tile(sample / kTile).memory;
      for (int64_t i = 0; i < width; ++i) to[ray * width + i] = tile.Row(row + i)[sample % kTile];
    };
    copy(rows.x, 3, picture.x);
    copy(rows.ambient, field.field().ambient_dim, picture.ambient);
    copy(rows.weights, field.field().num_key_points, picture.weights);
  }
  return colored;
}

}  // namespace editnerf
