#include "libeditnerf/field/fast_hyperspace.h"

#include <algorithm>
#include <cmath>

#include "libeditnerf/base/shape.h"
#include "libeditnerf/field/spherical_harmonics.h"
#include "libeditnerf/field/truncated_exp.h"
#include "libeditnerf/kernels/hash_encoding.h"

namespace editnerf {
namespace {

constexpr double kTableInit = 1e-4;
// Over this share of its cube's half side, the local encoding fades to zero, so that nothing jumps at the border.
constexpr double kFade = 0.125;

torch::Tensor MakeTable(const HashEncodingConfig& config) {
  return torch::empty({config.num_levels, int64_t{1} << config.log2_table_size, config.features_per_level})
      .uniform_(-kTableInit, kTableInit);
}

std::vector<int64_t> Resolutions(const HashEncodingConfig& config) {
  return HashResolutions(config.num_levels, config.base_resolution, config.finest_resolution);
}

// As fine in each room as one alone would be.
std::vector<int64_t> Resolutions(const HashEncodingConfig& config, int64_t rooms) {
  std::vector<int64_t> resolutions = Resolutions(config);
  for (int64_t& resolution : resolutions) resolution *= rooms;
  return resolutions;
}

int64_t Width(const HashEncodingConfig& config) { return config.num_levels * config.features_per_level; }

torch::Tensor RoomCorners(int64_t num_key_points) {
  torch::Tensor corners = torch::zeros({num_key_points, 3});
  for (int64_t i = 0; i < num_key_points; ++i) {
    const auto corner = RoomOf(i, RoomsFor(num_key_points));
    for (int64_t axis = 0; axis < 3; ++axis) corners[i][axis] = corner[static_cast<size_t>(axis)];
  }
  return corners;
}

// Where a part is and how it turns is settled by what is coarse, before what is fine fixes it: the coarser half of the
// levels is there at once, the others come in one after the other. Empty once all are open.
std::vector<float> WindowsAt(const FastFieldConfig& config, int64_t step) {
  if (step >= config.local_window_steps) return {};
  const auto levels = static_cast<double>(config.local_hash.num_levels), first = levels / 2;
  const double done = static_cast<double>(step) / static_cast<double>(config.local_window_steps);
  std::vector<float> windows;
  for (int64_t l = 0; l < config.local_hash.num_levels; ++l) {
    const double share = std::clamp(first + (levels - first) * done - static_cast<double>(l), 0.0, 1.0);
    windows.push_back(static_cast<float>((1 - std::cos(M_PI * share)) / 2));
  }
  return windows;
}

// Rows: two axes across the light and one along it.
torch::Tensor ShadeAxes(const std::optional<Vec3>& lamp, double along_light) {
  if (!lamp) return torch::eye(3);
  const auto [u, v] = Across(*lamp);
  const Vec3 w = *lamp * along_light;
  return torch::tensor({u.x, u.y, u.z, v.x, v.y, v.z, w.x, w.y, w.z}, torch::kFloat32).view({3, 3});
}

}  // namespace

FastHyperspace::FastHyperspace(const FastHyperspaceOptions& options) : options_(options) {
  const FastFieldConfig& config = options_.config;
  canonical_resolutions_ = Resolutions(config.canonical_hash);
  canonical_table_ = register_parameter("canonical_table", MakeTable(config.canonical_hash));
  int64_t features = Width(config.canonical_hash);
  if (options_.ambient_dim > 0) {
    ambient_encoding_.emplace(options_.ambient_dim, AmbientOctaves());
    features += ambient_encoding_->output_dim();
  }
  if (options_.num_key_points > 0) {
    local_resolutions_ = Resolutions(config.local_hash, RoomsFor(options_.num_key_points));
    rooms_ = register_buffer("rooms", RoomCorners(options_.num_key_points));
    local_table_ = register_parameter("local_table", MakeTable(config.local_hash));
    features += Width(config.local_hash);
  }
  if (HasShade()) {
    shade_resolutions_ = Resolutions(config.shade_hash, RoomsFor(options_.num_key_points));
    shade_table_ = register_parameter("shade_table", MakeTable(config.shade_hash));
    shade_axes_ = register_buffer("shade_axes", ShadeAxes(options_.lamp, config.shade_along_light));
  }
  const Box& box = options_.box;
  box_low_ = register_buffer("box_low", torch::tensor({box.low.x, box.low.y, box.low.z}, torch::kFloat32));
  MlpOptions density;
  density.in = features;
  density.depth = config.density_depth;
  density.width = config.width;
  density.out = 1 + config.geometry_features;
  density_network_ = register_module("density_network", Mlp(density));
  MlpOptions color;
  color.in = config.geometry_features + (options_.use_direction ? kNumSphericalHarmonics : 0) +
             options_.appearance_dim + (HasShade() ? Width(config.shade_hash) : 0);
  color.depth = config.color_depth;
  color.width = config.width;
  color.out = 3;
  color_network_ = register_module("color_network", Mlp(color));
}

void FastHyperspace::SetStep(int64_t step) {
  if (options_.num_key_points > 0) {
    local_windows_ = WindowsAt(options_.config, step);
    return;
  }
  // What stands still is learnt first; otherwise every frame grows a world of its own, and the space stays foggy.
  ambient_window_ = WindowAlpha(step, options_.config.ambient_window_delay, options_.config.ambient_window_steps, 1);
}

torch::Tensor FastHyperspace::InLocalCube(const torch::Tensor& offset, torch::Tensor* fade) const {
  torch::Tensor local = offset / (options_.box.LongestSide() * options_.config.local_extent);
  const torch::Tensor margin = 1 - 2 * std::get<0>(local.detach().abs().max(-1, true));
  *fade = (margin / kFade).clamp(0, 1);
  return local;
}

torch::Tensor FastHyperspace::ShadeFeatures(const HyperspaceInput& input) const {
  const int64_t samples = input.x_canonical.size(0), number = options_.num_key_points;
  CheckShape(input.from_keys, {samples, number, 3}, "fast field from_keys");
  torch::Tensor fade;
  const torch::Tensor unit =
      ((InLocalCube(input.from_keys.matmul(shade_axes_.t()), &fade) + 0.5).clamp(0, 1) + rooms_) /
      static_cast<double>(RoomsFor(number));
  const torch::Tensor encoded = HashEncode(unit.reshape({-1, 3}), shade_table_, shade_resolutions_);
  return (encoded.view({samples, number, -1}) * fade).sum(1);
}

torch::Tensor FastHyperspace::LocalFeatures(const HyperspaceInput& input) const {
  const int64_t samples = input.x_canonical.size(0), number = options_.num_key_points;
  CheckShape(input.local, {samples, 3}, "fast field local");
  const FastFieldConfig& config = options_.config;
  torch::Tensor fade;
  torch::Tensor unit = InLocalCube(input.local, &fade) + 0.5;
  if (number > 1) {
    CheckShape(input.weights, {samples, number}, "fast field weights");
    unit = unit.clamp(0, 1);
    for (int64_t i = 0; i < number; ++i) unit = unit + input.weights.slice(1, i, i + 1) * rooms_[i];
    unit = unit / static_cast<double>(RoomsFor(number));
  }
  torch::Tensor encoded = HashEncode(unit, local_table_, local_resolutions_) * fade;
  if (local_windows_.empty()) return encoded;
  const torch::Tensor windows = torch::tensor(local_windows_, encoded.options());
  return encoded * windows.repeat_interleave(config.local_hash.features_per_level);
}

torch::Tensor FastHyperspace::DensityFeatures(const HyperspaceInput& input) {
  CheckShape(input.x_canonical, {kAny, 3}, "fast field x_canonical");
  const double side = options_.box.LongestSide();
  std::vector<torch::Tensor> features = {
      HashEncode((input.x_canonical - box_low_) / side, canonical_table_, canonical_resolutions_)};
  if (options_.num_key_points > 0) features.push_back(LocalFeatures(input));
  if (ambient_encoding_) {
    CheckShape(input.ambient, {input.x_canonical.size(0), options_.ambient_dim}, "fast field ambient");
    features.push_back(ambient_encoding_->forward(input.ambient) * ambient_window_);
  }
  return density_network_->forward(features);
}

torch::Tensor FastHyperspace::Density(const HyperspaceInput& input) {
  return TruncatedExp(DensityFeatures(input).select(1, 0) + options_.config.density_bias);
}

HyperspaceOutput FastHyperspace::Evaluate(const HyperspaceInput& input) {
  const torch::Tensor out = DensityFeatures(input);
  std::vector<torch::Tensor> features = {out.slice(1, 1)};
  if (options_.use_direction) features.push_back(SphericalHarmonics(input.direction));
  if (options_.appearance_dim > 0) {
    CheckShape(input.appearance, {out.size(0), options_.appearance_dim}, "fast field appearance");
    features.push_back(input.appearance);
  }
  if (HasShade()) features.push_back(ShadeFeatures(input));
  HyperspaceOutput result;
  result.density = TruncatedExp(out.select(1, 0) + options_.config.density_bias);
  result.radiance = color_network_->forward(features).sigmoid();
  return result;
}

void FastHyperspace::AddTo(FusedField* field) const {
  const FastFieldConfig& config = options_.config;
  const Vec3& low = options_.box.low;
  field->canonical = {canonical_table_, canonical_resolutions_, canonical_copy_};
  field->low = {static_cast<float>(low.x), static_cast<float>(low.y), static_cast<float>(low.z)};
  field->side = static_cast<float>(options_.box.LongestSide());
  if (options_.num_key_points > 0) field->local = {local_table_, local_resolutions_, local_copy_};
  if (HasShade()) {
    field->shade = {shade_table_, shade_resolutions_, shade_copy_};
    const torch::Tensor axes = shade_axes_.to(torch::kCPU, torch::kFloat32).contiguous();
    std::copy_n(axes.data_ptr<float>(), field->shade_axes.size(), field->shade_axes.begin());
  }
  field->local_windows = local_windows_;
  field->local_side = static_cast<float>(options_.box.LongestSide() * config.local_extent);
  field->fade_margin = static_cast<float>(kFade);
  field->ambient_dim = options_.ambient_dim;
  field->ambient_octaves = AmbientOctaves();
  field->ambient_window = static_cast<float>(ambient_window_);
  field->density = density_network_->Layers();
  field->density_bias = static_cast<float>(config.density_bias);
  field->density_limit = static_cast<float>(kMaxLogDensity);
  field->color = color_network_->Layers();
  field->use_direction = options_.use_direction;
  field->appearance_dim = options_.appearance_dim;
}

}  // namespace editnerf
