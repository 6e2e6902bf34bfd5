#include "libeditnerf/kernels/fused_field.h"

#include <algorithm>

#include "libeditnerf/base/error.h"
#include "libeditnerf/base/shape.h"
#include "libeditnerf/kernels/harmonics.h"
#include "libeditnerf/kernels/kernel_use.h"
#include "libeditnerf/kernels/sinusoids.h"

namespace editnerf {
namespace {

bool IsPlain(const at::Tensor& tensor) { return KernelsTake(tensor) && (!tensor.defined() || tensor.is_contiguous()); }

bool IsPlain(const MlpLayers& layers) {
  const auto plain = [](const at::Tensor& tensor) { return IsPlain(tensor); };
  return std::all_of(layers.weights.begin(), layers.weights.end(), plain) &&
         std::all_of(layers.biases.begin(), layers.biases.end(), plain);
}

bool IsPlain(const FusedHash& hash) {
  return !hash.table.defined() || (IsPlain(hash.table) && hash.table.dim() == 3 && hash.table.size(2) == 2);
}

int64_t Width(const FusedHash& hash) { return hash.table.defined() ? hash.table.size(0) * hash.table.size(2) : 0; }

int64_t Encoded(int64_t dim, int64_t octaves) { return dim * (1 + 2 * octaves); }

int64_t OutOf(const MlpLayers& layers) { return layers.weights.empty() ? 0 : layers.weights.back().size(0); }

int64_t Activations(const MlpLayers& layers) {
  int64_t rows = 0;
  for (const at::Tensor& weight : layers.weights) rows += weight.size(0);
  return rows;
}

void CheckIn(const MlpLayers& layers, int64_t in, const char* name) {
  if (layers.weights.empty()) return;
  CheckShape(layers.weights.front(), {kAny, in}, name);
}

}  // namespace

bool CanFuse(const FusedField& field) {
  return IsPlain(field.canonical) && IsPlain(field.local) && IsPlain(field.shade) && IsPlain(field.weights) &&
         IsPlain(field.slicing) && IsPlain(field.density) && IsPlain(field.color) && IsPlain(field.anchors) &&
         IsPlain(field.key_scale) && IsPlain(field.key_offset) &&
         std::max({field.weight_octaves, field.slicing_octaves, field.ambient_octaves}) <= kMostFusedOctaves;
}

int64_t OpenLocalLevels(const FusedField& field) {
  auto open = static_cast<int64_t>(field.local.resolutions.size());
  if (field.local_windows.empty()) return open;
  while (open > 0 && field.local_windows[static_cast<size_t>(open - 1)] == 0) --open;
  return open;
}

void CheckFused(const FusedField& field, const FusedStates& states) {
  const FieldRows rows(field);
  if (!field.local_windows.empty() && field.local_windows.size() != field.local.resolutions.size()) {
    Throw<ShapeError>("fused local windows: expected {} or none, found {}", field.local.resolutions.size(),
                      field.local_windows.size());
  }
  CheckIn(field.weights, Encoded(3, field.weight_octaves), "fused weight network");
  CheckIn(field.slicing, Encoded(3, field.slicing_octaves) + field.code_dim, "fused slicing network");
  CheckIn(field.density, rows.num_features, "fused density network");
  CheckIn(field.color, rows.color_act - rows.density_out - 1, "fused colour network");
  const auto check = [](const at::Tensor& table, at::IntArrayRef shape, const char* name) {
    if (!table.defined()) Throw<ShapeError>("{}: this field needs them, and the frame states have none", name);
    if (table.sizes().slice(1) != shape || !table.is_cpu() || table.scalar_type() != at::kFloat) {
      Throw<ShapeError>("{}: expected float32 on the CPU and the field's sizes, found {}", name, ShapeString(table));
    }
  };
  if (field.num_key_points > 0) check(states.key_points, {field.num_key_points, 3}, "key points");
  if (states.casters.defined()) {
    check(states.casters, {field.num_key_points, 3}, "casters");
    if (states.casters.size(0) != states.key_points.size(0)) {
      Throw<ShapeError>("casters: expected one row for each of the {} states, found {}", states.key_points.size(0),
                        states.casters.size(0));
    }
  }
  if (field.local_frames) check(states.local_frames, {field.num_key_points, 3, 3}, "local frames");
  if (field.code_dim > 0) check(states.warp_code, {field.code_dim}, "warp codes");
  if (field.appearance_dim > 0) check(states.appearance, {field.appearance_dim}, "appearance codes");
}

FieldRows::FieldRows(const FusedField& field) {
  const int64_t n = field.num_key_points;
  const bool weighted = n > 1;
  int64_t next = 0;
  const auto take = [&](int64_t rows) {
    next += rows;
    return next - rows;
  };
  canonical_features = Width(field.canonical);
  local_features = Width(field.local);
  shade_features = Width(field.shade);
  ambient_features = field.ambient_dim > 0 ? Encoded(field.ambient_dim, field.ambient_octaves) : 0;
  num_features = canonical_features + local_features + ambient_features;

  t = take(1), slot = take(1), x = take(3), unit = take(3);
  keys = take(weighted || field.local_frames ? 3 * n : 0);
  frames = take(field.local_frames ? 9 * n : 0);
  weight_in = take(weighted ? Encoded(3, field.weight_octaves) : 0);
  weight_act = take(Activations(field.weights));
  weights = next - (weighted ? n : 0);
  anchor = take(n > 0 ? 3 : 0);
  turned = take(field.local_frames ? 3 : 0);
  local = take(local_features > 0 ? 3 : 0);
  fade = take(local_features > 0 ? 1 : 0);
  slicing_in = take(field.slicing.weights.empty() ? 0 : Encoded(3, field.slicing_octaves) + field.code_dim);
  slicing_act = take(Activations(field.slicing) - OutOf(field.slicing));
  ambient = take(field.ambient_dim);  // also the slicing network's output
  features = take(num_features);
  density = take(1);
  density_act = take(Activations(field.density) - OutOf(field.density));
  density_out = take(OutOf(field.density));
  harmonics = take(field.use_direction ? kNumHarmonics : 0);
  appearance = take(field.appearance_dim);
  shade = take(shade_features);
  color_act = take(Activations(field.color));
  color = next - OutOf(field.color);
  grad_density_out = take(OutOf(field.density));
  grad_color = take(3);
  shade_unit = take(shade_features > 0 ? 3 * n : 0);
  shade_fade = take(shade_features > 0 ? n : 0);
  shade_each = take(shade_features);
  pull = take(1);
  chosen = take(1);
  count = next;
  for_gradients = {{0, harmonics}};
  for_pictures = {{t, 5}, {ambient, field.ambient_dim}, {density, 1}, {density_out, OutOf(field.density)}};
  if (weighted) for_pictures.push_back({weights, n});
  for_backward = {{slot, grad_density_out + 1 - slot}, {grad_color, chosen - grad_color}};
}

}  // namespace editnerf
