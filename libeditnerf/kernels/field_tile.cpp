#include "libeditnerf/kernels/field_tile.h"

#include <c10/util/SmallVector.h>

#include <algorithm>

#include "libeditnerf/base/phase_clock.h"
#include "libeditnerf/kernels/gradient.h"
#include "libeditnerf/kernels/hash_level.h"
#include "libeditnerf/kernels/tile_functions.h"

namespace editnerf {
namespace {

// Copies row state[s] of table [F, width] into `width` rows.
void SpreadRows(const float* table, int64_t width, const int32_t* state, int64_t count, float* rows) {
  for (int64_t s = 0; s < count; ++s) {
    const float* const from = table + state[s] * width;
    for (int64_t i = 0; i < width; ++i) TileRow(rows, i)[s] = from[i];
  }
}

// body(key point, axis, corner) for every corner of a room that is not 0.
template <class Body>
void ForRooms(int64_t num_key_points, const Body& body) {
  const int64_t rooms = RoomsFor(num_key_points);
  for (int64_t i = 1; i < num_key_points; ++i) {
    const auto corner = RoomOf(i, rooms);
    for (int64_t axis = 0; axis < 3; ++axis) {
      if (const float at = corner[static_cast<size_t>(axis)]; at > 0) body(i, axis, at);
    }
  }
}

}  // namespace

void FieldSums::Clear() {
  for (TileMlpSums* sums : {&density, &color, &weights, &slicing}) sums->Clear();
}

void FieldSums::Add(const FieldSums& other) {
  density.Add(other.density);
  color.Add(other.color);
  weights.Add(other.weights);
  slicing.Add(other.slicing);
}

FieldKernel::FieldKernel(const FusedField& field, const FusedStates& states)
    : field_(field),
      states_(states),
      rows_(field),
      density_(field.density, field.bf16),
      color_(field.color, field.bf16),
      // l is as exact as the weights are, and the finest cells of its hash are a thousandth of its cube.
      weights_(field.weights, field.bf16, /*exact=*/true),
      slicing_(field.slicing, field.bf16) {
  CheckFused(field, states);
  open_levels_ = OpenLocalLevels(field);
  for (FusedHash* hash : {&field_.canonical, &field_.local, &field_.shade}) {
    if (field_.bf16 == Bf16Unit::kNone || !hash->table.defined()) hash->bf16.reset();
    if (hash->bf16) hash->bf16->Refresh(hash->table);
  }
  const auto data = [&](at::Tensor& table) -> const float* {
    if (!table.defined()) return nullptr;
    table = table.detach().contiguous();
    num_states_ = table.size(0);
    return table.data_ptr<float>();
  };
  if (field_.code_dim > 0) codes_ = data(states_.warp_code);
  if (field_.appearance_dim > 0) appearances_ = data(states_.appearance);
  const int64_t n = field_.num_key_points;
  if (n == 0) return;
  keys_ = data(states_.key_points);
  casters_ = states_.casters.defined() ? data(states_.casters) : keys_;
  if (field_.local_frames) frames_ = data(states_.local_frames);
  const float *const scale = field_.key_scale.data_ptr<float>(), *const offset = field_.key_offset.data_ptr<float>();
  local_keys_.resize(static_cast<size_t>(num_states_ * n * 3));
  for (int64_t i = 0; i < num_states_ * n * 3; ++i) {
    local_keys_[static_cast<size_t>(i)] = keys_[i] * scale[i / 3 % n] + offset[i % (3 * n)];
  }
}

void FieldKernel::Encode(const FusedHash& hash, int64_t levels, const float* unit, int64_t count, float* out) const {
  const ThreadPhase phase(Phase::kEncoding);
  const int64_t table_size = hash.table.size(1);
  const float* const table = hash.table.data_ptr<float>();
  const HashPoints points = {count, {TileRow(unit, 0), TileRow(unit, 1), TileRow(unit, 2)}};
  for (int64_t level = 0; level < levels; ++level) {
    const HashLevel where = {hash.resolutions[static_cast<size_t>(level)], table_size};
    float *const out0 = TileRow(out, 2 * level), *const out1 = TileRow(out, 2 * level + 1);
    if (hash.bf16) {
      EncodeBf16HashLevel(points, where, hash.bf16->Level(level), out0, out1);
    } else {
      EncodeHashLevel(points, where, table + 2 * level * table_size, out0, out1);
    }
  }
}

// The local features, but nothing is looked up for vectors of samples that all lie outside the local cube (fade 0): in
// pictures, where neighbours lie side by side, that is often the half of them.
void FieldKernel::EncodeWithin(const float* fade, const float* unit, int64_t count, float* out) const {
  constexpr int64_t kGroup = 16;
  const int64_t padded = PaddedSamples(count);
  for (int64_t row = 2 * open_levels_; row < rows_.local_features; ++row) std::fill_n(TileRow(out, row), padded, 0.0F);
  const auto is_outside = [&](int64_t s) {
    return std::all_of(fade + s, fade + std::min(s + kGroup, count), [](float share) { return share == 0; });
  };
  for (int64_t begin = 0; begin < padded;) {
    const bool outside = is_outside(begin);
    int64_t end = begin + kGroup;
    while (end < padded && is_outside(end) == outside) end += kGroup;
    if (outside) {
      for (int64_t row = 0; row < 2 * open_levels_; ++row)
        std::fill(TileRow(out, row) + begin, TileRow(out, row) + end, 0.0F);
    } else {
      Encode(field_.local, open_levels_, unit + begin, std::min(end, count) - begin, out + begin);
    }
    begin = end;
  }
}

// From the unit coordinates of one room to those of all.
void FieldKernel::GoToRooms(int64_t count, TileMemory& tile) const {
  const int64_t n = field_.num_key_points, rooms = RoomsFor(n);
  if (n == 1) return;
  float* const unit = tile.Row(rows_.local);
  ForRooms(n, [&](int64_t i, int64_t axis, float corner) {
    float* const row = TileRow(unit, axis);
    AddRows(row, TileRow(tile.Row(rows_.weights), i), corner, 1, count, row);
  });
  ScaleRows(1 / static_cast<float>(rooms), 3, count, unit);
}

// grad_weights += factor * corners times grad [3 rows].
void FieldKernel::RoomsBackward(int64_t count, const float* grad, float factor, float* grad_weights) const {
  ForRooms(field_.num_key_points, [&](int64_t i, int64_t axis, float corner) {
    float* const row = TileRow(grad_weights, i);
    AddRows(row, TileRow(grad, axis), factor * corner, 1, count, row);
  });
}

void FieldKernel::ScaleByWindows(int64_t count, float* local_features) const {
  for (size_t l = 0; l < field_.local_windows.size(); ++l) {
    if (field_.local_windows[l] != 1)
      ScaleRows(field_.local_windows[l], 2, count, TileRow(local_features, 2 * static_cast<int64_t>(l)));
  }
}

// Key points, weights and what follows from them: the anchor p and its local coordinates.
void FieldKernel::Anchors(const int32_t* state, int64_t count, bool for_gradients, TileMemory& tile) const {
  const int64_t n = field_.num_key_points;
  float *const anchor = tile.Row(rows_.anchor), *const ambient = tile.Row(rows_.ambient);
  if (n > 1 || field_.local_frames) SpreadRows(keys_, 3 * n, state, count, tile.Row(rows_.keys));
  if (field_.local_frames) SpreadRows(frames_, 9 * n, state, count, tile.Row(rows_.frames));
  if (n == 1) {
    SpreadRows(keys_, 3, state, count, anchor);
    SpreadRows(local_keys_.data(), 3, state, count, ambient);
    return;
  }
  const float* const x = tile.Row(rows_.x);
  EncodeTile(x, 3, field_.weight_octaves, 1, count, tile.Row(rows_.weight_in));
  weights_.Forward(tile.Row(rows_.weight_in), count, tile.Row(rows_.weight_act), for_gradients);
  float* const weights = tile.Row(rows_.weights);
  if (field_.prior > 0) {
    SubtractDistances(x, field_.anchors.data_ptr<float>(), n, field_.anchors.size(1), field_.prior, count, weights);
  }
  Softmax(n, count, weights);
  WeightedSum(weights, tile.Row(rows_.keys), field_.key_scale.data_ptr<float>(), field_.key_offset.data_ptr<float>(), n,
              count, anchor, ambient);
}

void FieldKernel::Slices(const int32_t* state, int64_t count, bool for_gradients, TileMemory& tile) const {
  float* const in = tile.Row(rows_.slicing_in);
  EncodeTile(tile.Row(rows_.x), 3, field_.slicing_octaves, 1, count, in);
  SpreadRows(codes_, field_.code_dim, state, count, TileRow(in, slicing_.in() - field_.code_dim));
  // The last of its rows are the ambient coordinates.
  slicing_.Forward(in, count, tile.Row(rows_.slicing_act), for_gradients);
}

void FieldKernel::Density(const int32_t* state, int64_t count, bool for_gradients, TileMemory& tile) const {
  float* const features = tile.Row(rows_.features);
  const float* const x = tile.Row(rows_.x);
  UnitCoordinates(x, field_.low.data(), field_.side, count, tile.Row(rows_.unit));
  Encode(field_.canonical, rows_.canonical_features / 2, tile.Row(rows_.unit), count, features);
  if (field_.num_key_points > 0) Anchors(state, count, for_gradients, tile);
  if (!slicing_.empty()) Slices(state, count, for_gradients, tile);
  if (rows_.local_features > 0) {
    float* const encoded = TileRow(features, rows_.canonical_features);
    if (field_.local_frames) {
      SumInFrames(x, WeightsOf(tile), tile.Row(rows_.keys), tile.Row(rows_.frames), field_.num_key_points, count,
                  tile.Row(rows_.turned));
    }
    LocalCoordinates(field_.local_frames ? tile.Row(rows_.turned) : x,
                     field_.local_frames ? nullptr : tile.Row(rows_.anchor), field_.local_side, field_.fade_margin,
                     count, tile.Row(rows_.local), tile.Row(rows_.fade));
    GoToRooms(count, tile);
    EncodeWithin(tile.Row(rows_.fade), tile.Row(rows_.local), count, encoded);
    ScaleRows(tile.Row(rows_.fade), 2 * open_levels_, count, encoded);
    ScaleByWindows(count, encoded);
  }
  if (field_.ambient_dim > 0) {
    EncodeTile(tile.Row(rows_.ambient), field_.ambient_dim, field_.ambient_octaves, field_.ambient_window, count,
               TileRow(features, rows_.num_features - rows_.ambient_features));
  }
  density_.Forward(features, count, tile.Row(rows_.density_act), for_gradients);
  DensityOf(tile.Row(rows_.density_out), field_.density_bias, field_.density_limit, count, tile.Row(rows_.density));
}

// Every place as each key point sees it, in the key point's room.
void FieldKernel::Shade(const int32_t* state, int64_t count, TileMemory& tile) const {
  const int64_t n = field_.num_key_points, rooms = RoomsFor(n);
  const int64_t levels = rows_.shade_features / 2, padded = PaddedSamples(count);
  const auto per_room = 1 / static_cast<float>(rooms);
  const float* const x = tile.Row(rows_.x);
  const std::array<float, 9>& axes = field_.shade_axes;
  for (int64_t i = 0; i < n; ++i) {
    float *const unit = tile.Row(rows_.shade_unit + 3 * i), *const fade = tile.Row(rows_.shade_fade + i);
    for (int64_t s = 0; s < count; ++s) {
      const float* const caster = casters_ + 3 * (state[s] * n + i);
      const float apart[3] = {x[s] - caster[0], TileRow(x, 1)[s] - caster[1], TileRow(x, 2)[s] - caster[2]};
      for (int64_t axis = 0; axis < 3; ++axis) {
        const float* const to = axes.data() + 3 * axis;
        TileRow(unit, axis)[s] = to[0] * apart[0] + to[1] * apart[1] + to[2] * apart[2];
      }
    }
    LocalCoordinates(unit, nullptr, field_.local_side, field_.fade_margin, count, unit, fade);
    const auto corner = RoomOf(i, rooms);
    for (int64_t axis = 0; axis < 3; ++axis) {
      float* const row = TileRow(unit, axis);
      for (int64_t s = 0; s < padded; ++s) row[s] = (row[s] + corner[static_cast<size_t>(axis)]) * per_room;
    }
    float *const sum = tile.Row(rows_.shade), *const each = i == 0 ? sum : tile.Row(rows_.shade_each);
    Encode(field_.shade, levels, unit, count, each);
    if (i == 0) {
      ScaleRows(fade, rows_.shade_features, count, sum);
    } else {
      AddScaledRows(fade, each, rows_.shade_features, count, sum);
    }
  }
}

// grad [N shade_features]: the first of them with respect to the sum in, with respect to each key point's look-up out.
void FieldKernel::ShadeBackward(int64_t count, const TileMemory& tile, float* grad) const {
  for (int64_t i = field_.num_key_points; i-- > 0;) {
    float* const own = TileRow(grad, i * rows_.shade_features);
    if (i > 0) std::copy_n(grad, rows_.shade_features * kTileStride, own);
    ScaleRows(tile.Row(rows_.shade_fade + i), rows_.shade_features, count, own);
  }
}

void FieldKernel::Color(const int32_t* state, int64_t count, bool for_gradients, TileMemory& tile) const {
  if (field_.appearance_dim > 0) {
    SpreadRows(appearances_, field_.appearance_dim, state, count, tile.Row(rows_.appearance));
  }
  if (rows_.shade_features > 0) Shade(state, count, tile);
  color_.Forward(tile.Row(rows_.density_out + 1), count, tile.Row(rows_.color_act), for_gradients);
  Sigmoid(3, count, tile.Row(rows_.color));
}

int64_t FieldKernel::scratch_rows() const {
  int64_t rows = 0;
  for (const TileMlp* mlp : {&density_, &color_, &weights_, &slicing_}) rows = std::max(rows, mlp->scratch_rows());
  return rows + rows_.ambient_features + field_.ambient_dim + field_.num_key_points + 6;
}

void FieldKernel::Backward(int64_t count, TileMemory& tile, TileMemory& scratch, FieldSums& sums,
                           const TileGradients& to) const {
  float* const grad_out = tile.Row(rows_.grad_density_out);
  float* const networks = scratch.Row(rows_.ambient_features + field_.ambient_dim + field_.num_key_points + 6);
  const int64_t geometry = density_.out() - 1;
  c10::SmallVector<InputGradient, 3> parts;
  parts.push_back({0, geometry, TileRow(grad_out, 1)});
  if (field_.appearance_dim > 0) {
    parts.push_back({color_.in() - rows_.shade_features - field_.appearance_dim, field_.appearance_dim, to.appearance});
  }
  if (rows_.shade_features > 0) parts.push_back({color_.in() - rows_.shade_features, rows_.shade_features, to.shade});
  color_.Backward(tile.Row(rows_.density_out + 1), tile.Row(rows_.color_act), tile.Row(rows_.grad_color), count,
                  networks, sums.color, parts);
  if (rows_.shade_features > 0) ShadeBackward(count, tile, to.shade);

  float *const grad_encoded = scratch.Row(0), *const grad_ambient = scratch.Row(rows_.ambient_features);
  parts.clear();
  parts.push_back({0, rows_.canonical_features, to.canonical});
  if (rows_.local_features > 0) parts.push_back({rows_.canonical_features, rows_.local_features, to.local});
  if (field_.ambient_dim > 0) {
    parts.push_back({rows_.num_features - rows_.ambient_features, rows_.ambient_features, grad_encoded});
  }
  density_.Backward(tile.Row(rows_.features), tile.Row(rows_.density_act), grad_out, count, networks, sums.density,
                    parts);
  if (field_.ambient_dim == 0) return;
  if (rows_.local_features > 0) {
    ScaleRows(tile.Row(rows_.fade), rows_.local_features, count, to.local);
    ScaleByWindows(count, to.local);
  }
  EncodeTileGradient(tile.Row(rows_.features + rows_.num_features - rows_.ambient_features), grad_encoded,
                     field_.ambient_dim, field_.ambient_octaves, field_.ambient_window, count, grad_ambient);
  AddScaledRows(tile.Row(rows_.pull), tile.Row(rows_.ambient), field_.ambient_dim, count, grad_ambient);
  if (!slicing_.empty()) {
    parts.clear();
    parts.push_back({slicing_.in() - field_.code_dim, field_.code_dim, to.code});
    slicing_.Backward(tile.Row(rows_.slicing_in), tile.Row(rows_.slicing_act), grad_ambient, count, networks,
                      sums.slicing, parts);
    return;
  }
  KeyPointsBackward(count, grad_ambient, tile, scratch.Row(rows_.ambient_features + field_.ambient_dim), sums, to);
}

void FieldKernel::KeyPointsBackward(int64_t count, const float* grad_ambient, TileMemory& tile, float* scratch,
                                    FieldSums& sums, const TileGradients& to) const {
  const int64_t n = field_.num_key_points;
  float *const grad_weights = scratch, *const grad_anchor = TileRow(scratch, n);
  const float per_unit = (field_.local_frames ? 1.0F : -1.0F) / (field_.local_side * static_cast<float>(RoomsFor(n)));
  // The slope with respect to l is what the anchor gets, but for the sign; in local frames the anchor gets nothing.
  float* const grad_local = field_.local_frames ? TileRow(scratch, n + 3) : grad_anchor;
  float* const axes[3] = {grad_local, TileRow(grad_local, 1), TileRow(grad_local, 2)};
  for (int64_t row = 0; row < 3; ++row) {
    std::fill_n(TileRow(grad_anchor, row), kTile, 0.0F);
    std::fill_n(axes[row], kTile, 0.0F);
  }
  if (rows_.local_features > 0) {
    const ThreadPhase phase(Phase::kTableGradients);
    const int64_t table_size = field_.local.table.size(1);
    const float* const table = field_.local.table.data_ptr<float>();
    const HashPoints points = {count, {tile.Row(rows_.local), tile.Row(rows_.local + 1), tile.Row(rows_.local + 2)}};
    for (int64_t level = 0; level < open_levels_; ++level) {
      const HashLevel where = {field_.local.resolutions[static_cast<size_t>(level)], table_size};
      const float *const grad0 = TileRow(to.local, 2 * level), *const grad1 = TileRow(to.local, 2 * level + 1);
      if (field_.local.bf16) {
        SlopeBf16HashLevel(points, where, field_.local.bf16->Level(level), grad0, grad1, axes);
      } else {
        SlopeHashLevel(points, where, table + 2 * level * table_size, grad0, grad1, axes);
      }
    }
    ScaleRows(per_unit, 3, count, grad_local);
  }
  const auto add_frames = [&](float* to_weights) {
    if (!field_.local_frames) return;
    SumInFramesGradient(tile.Row(rows_.x), WeightsOf(tile), tile.Row(rows_.keys), tile.Row(rows_.frames), n, count,
                        grad_local, to_weights, to.keys, to.frames);
  };
  const float *const scale = field_.key_scale.data_ptr<float>(), *const offset = field_.key_offset.data_ptr<float>();
  if (n == 1) {
    AddRows(grad_anchor, grad_ambient, scale[0], 3, count, to.keys);
    add_frames(nullptr);
    return;
  }
  float* const weights = tile.Row(rows_.weights);
  WeightedSumGradient(weights, tile.Row(rows_.keys), scale, offset, n, count, grad_anchor, grad_ambient, grad_weights,
                      to.keys);
  add_frames(grad_weights);
  if (rows_.local_features > 0) {
    RoomsBackward(count, grad_local, 1 / (per_unit * static_cast<float>(RoomsFor(n))), grad_weights);
  }
  SoftmaxGradient(weights, n, count, grad_weights);
  weights_.Backward(tile.Row(rows_.weight_in), tile.Row(rows_.weight_act), grad_weights, count, TileRow(scratch, n + 6),
                    sums.weights, {});
}

FieldSums FieldKernel::MakeSums() const {
  return {density_.MakeSums(), color_.MakeSums(), weights_.MakeSums(), slicing_.MakeSums()};
}

void FieldKernel::AddToGradients(const FieldSums& sums) const {
  const auto add = [](const TileMlp& mlp, const TileMlpSums& from, const MlpLayers& layers) {
    for (size_t l = 0; l < layers.weights.size(); ++l) {
      mlp.AddSums(from, l, GradientOf(layers.weights[l]), GradientOf(layers.biases[l]));
    }
  };
  add(density_, sums.density, field_.density);
  add(color_, sums.color, field_.color);
  add(weights_, sums.weights, field_.weights);
  add(slicing_, sums.slicing, field_.slicing);
}

}  // namespace editnerf
