// The fast field over one tile of samples: forward in two passes, as colour is wanted of fewer samples than density,
// and backward. Activations stay in the tile between them.
#pragma once

#include <cstdint>
#include <vector>

#include "libeditnerf/kernels/fused_field.h"
#include "libeditnerf/kernels/tile.h"
#include "libeditnerf/kernels/tile_mlp.h"

namespace editnerf {

// Gradient sums of the small networks, over many tiles.
struct FieldSums {
  TileMlpSums density, color, weights, slicing;
  void Clear();
  void Add(const FieldSums& other);
};

// Where one tile's gradients go that are not sums. The tables' are scattered later (table_scatter.h), level by level.
struct TileGradients {
  float* canonical = nullptr;   // [canonical_features], with respect to the hash features
  float* local = nullptr;       // [local_features]
  float* shade = nullptr;       // [N shade_features], of each key point's look-up
  float* keys = nullptr;        // [3 N], with respect to the samples' key points, scene units
  float* frames = nullptr;      // [9 N], with respect to their local frames
  float* code = nullptr;        // [code_dim]
  float* appearance = nullptr;  // [appearance_dim]
};

class FieldKernel {
 public:
  // Throws ShapeError where the parts do not fit together. Holds on to the tensors.
  FieldKernel(const FusedField& field, const FusedStates& states);

  const FusedField& field() const { return field_; }
  const FieldRows& rows() const { return rows_; }
  const float* KeyPoints(int64_t state) const { return keys_ + state * 3 * field_.num_key_points; }  // [N, 3]
  const float* LocalFrames(int64_t state) const {  // [N, 3, 3]; nullptr where parts do not turn
    return frames_ == nullptr ? nullptr : frames_ + state * 9 * field_.num_key_points;
  }
  int64_t num_states() const { return num_states_; }  // -1: any

  // From the rows x to density: everything up to and without the harmonics. state [count]: row of the states.
  // for_gradients: whether Backward follows.
  void Density(const int32_t* state, int64_t count, bool for_gradients, TileMemory& tile) const;

  // From there and the harmonics to the radiance.
  void Color(const int32_t* state, int64_t count, bool for_gradients, TileMemory& tile) const;

  // Given grad_color, row 0 of grad_density_out and pull.
  void Backward(int64_t count, TileMemory& tile, TileMemory& scratch, FieldSums& sums, const TileGradients& to) const;
  int64_t scratch_rows() const;

  FieldSums MakeSums() const;

  // Adds the sums to the `.grad` of the networks' parameters, which is made where there is none.
  void AddToGradients(const FieldSums& sums) const;

 private:
  void Anchors(const int32_t* state, int64_t count, bool for_gradients, TileMemory& tile) const;
  const float* WeightsOf(const TileMemory& tile) const {  // nullptr for one key point
    return field_.num_key_points > 1 ? tile.Row(rows_.weights) : nullptr;
  }
  void Slices(const int32_t* state, int64_t count, bool for_gradients, TileMemory& tile) const;
  void Shade(const int32_t* state, int64_t count, TileMemory& tile) const;
  void ShadeBackward(int64_t count, const TileMemory& tile, float* grad) const;
  void GoToRooms(int64_t count, TileMemory& tile) const;
  void RoomsBackward(int64_t count, const float* grad, float factor, float* grad_weights) const;
  void ScaleByWindows(int64_t count, float* local_features) const;
  void Encode(const FusedHash& hash, int64_t levels, const float* unit, int64_t count, float* out) const;
  void EncodeWithin(const float* fade, const float* unit, int64_t count, float* out) const;
  void KeyPointsBackward(int64_t count, const float* grad_ambient, TileMemory& tile, float* scratch, FieldSums& sums,
                         const TileGradients& to) const;

  FusedField field_;
  FusedStates states_;
  FieldRows rows_;
  TileMlp density_, color_, weights_, slicing_;
  int64_t num_states_ = -1;
  const float *keys_ = nullptr, *casters_ = nullptr, *frames_ = nullptr, *codes_ = nullptr, *appearances_ = nullptr;
  int64_t open_levels_ = 0;        // of the local encoding
  std::vector<float> local_keys_;  // [F, N, 3], in local coordinates
};

}  // namespace editnerf
