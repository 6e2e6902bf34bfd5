// The fast field as plain data, for the kernels that evaluate all of it in one pass over tiles of samples.
//
//   p = k_t (one key point) or sum_i w^i(x) k_t^i,  w = softmax(W(gamma(x)) - prior d(x))
//   a = p in local coordinates, or in pretraining the slice S(gamma(x), beta_t)
//   l = x - p, or in local frames sum_i w^i R_t^i (x - k_t^i)
//   (log sigma, g) = density network (hash(x), fade hash(l), window gamma(a))
//   c = sigmoid(colour network (g, harmonics(d), alpha_t, s)),  s = sum_i fade hash(x - k_t^i)
//
// field/fast_hyperspace.h and its neighbours are the same in LibTorch's operations, and what these kernels are tested
// against. What a field does not have is left empty here and costs nothing.
#pragma once

#include <ATen/core/Tensor.h>

#include <array>
#include <cstdint>
#include <memory>
#include <vector>

#include "libeditnerf/kernels/bf16_table.h"
#include "libeditnerf/kernels/bf16_unit.h"
#include "libeditnerf/kernels/fused_mlp.h"

namespace editnerf {

struct FusedHash {
  at::Tensor table;                  // [L, T, 2]; undefined: no such encoding
  std::vector<int64_t> resolutions;  // L
  std::shared_ptr<Bf16Table> bf16;   // its copy, to look up in; nullptr: there is none
};

// Rooms along each axis of the local hash's cube, so that N key points have one each, and the corner of number i's.
inline int64_t RoomsFor(int64_t num_key_points) {
  int64_t rooms = 1;
  while (rooms * rooms * rooms < num_key_points) ++rooms;
  return rooms;
}
inline std::array<float, 3> RoomOf(int64_t i, int64_t rooms) {
  const int64_t x = i % rooms, y = i / rooms % rooms, z = i / (rooms * rooms);
  return {static_cast<float>(x), static_cast<float>(y), static_cast<float>(z)};
}

// Tensors are float32, contiguous, on the CPU, and the module's own: kernels read and differentiate them in place.
struct FusedField {
  FusedHash canonical;               // over (x - low) / side
  std::array<float, 3> low;          // scene units
  float side = 1;                    // scene units
  FusedHash local;                   // over l / local_side + 1/2; for N > 1 that + sum_i w^i room_i, over rooms
  float local_side = 1;              // scene units
  std::vector<float> local_windows;  // L factors of its features; empty: 1
  float fade_margin = 0.125;         // share of the local cube's half side over which its features fade to zero
  FusedHash shade;                   // over A (x - k_i) / local_side + 1/2 + room_i, over rooms; N > 1 alone
  // A, row by row.
  std::array<float, 9> shade_axes = {1, 0, 0, 0, 1, 0, 0, 0, 1};

  int64_t num_key_points = 0;        // N; 0: a static scene, or pretraining
  at::Tensor key_scale, key_offset;  // [N], [N, 3]: local coordinates are scale k + offset
  bool local_frames = false;         // whether parts turn as their key points move
  MlpLayers weights;                 // N > 1 alone
  int64_t weight_octaves = 0;
  at::Tensor anchors;  // [N, A, 3], positions of the initial tracks; undefined: no prior
  float prior = 0;     // per scene unit of distance to the nearest of them

  MlpLayers slicing;  // pretraining alone
  int64_t slicing_octaves = 0;
  int64_t code_dim = 0;  // of beta_t

  int64_t ambient_dim = 0;  // A; 0: a static scene
  int64_t ambient_octaves = 0;
  float ambient_window = 1;

  MlpLayers density;  // to 1 + geometry features
  float density_bias = 0, density_limit = 15;
  MlpLayers color;
  bool use_direction = false;
  int64_t appearance_dim = 0;

  // For the products; with one, tables are looked up in their copies. None: float32.
  Bf16Unit bf16 = Bf16Unit::kNone;
};

// Levels of the local encoding before the finer ones whose windows are still closed: those are not looked up.
int64_t OpenLocalLevels(const FusedField& field);

// What frames or edits put into the field, row by row; undefined where the field has no use for it.
struct FusedStates {
  at::Tensor key_points;    // [F, N, 3], scene units
  at::Tensor local_frames;  // [F, N, 3, 3], from scene axes to the parts' own
  at::Tensor warp_code;     // [F, code_dim]
  at::Tensor appearance;    // [F, appearance_dim]
  at::Tensor casters{};     // [F, N, 3], the key points that shade is seen from; undefined: key_points
};

// Whether all of it is float32, contiguous and on the CPU, with two features per table entry and few enough octaves.
bool CanFuse(const FusedField& field);

// Throws ShapeError unless sizes fit together, states included.
void CheckFused(const FusedField& field, const FusedStates& states);

struct RowRange {
  int64_t first, count;
};

// Rows of a tile, in the order in which they are computed.
struct FieldRows {
  explicit FieldRows(const FusedField& field);

  int64_t t, slot;                         // 1 each, of the ray bundle: distance along the ray, and which ray
  int64_t x;                               // 3, scene units
  int64_t unit;                            // 3, coordinates of the canonical hash
  int64_t keys, frames;                    // 3 N and 9 N, of the samples' states
  int64_t weight_in, weight_act, weights;  // encoding, activations, the last N of which are the weights
  int64_t anchor, turned, local, fade;     // p, l in local frames, l as the hash takes it: 3, 3, 3, 1
  int64_t slicing_in, slicing_act;         // encoding and code, activations
  int64_t ambient;                         // A
  int64_t features, density_act;           // input and activations of the density network
  int64_t density_out;                     // its output: log density, geometry features
  int64_t density;                         // 1, per scene unit
  int64_t harmonics, appearance, shade;    // behind the geometry features, with them the colour network's input
  int64_t color_act, color;                // activations, the last 3 of which are the radiance
  int64_t grad_density_out;                // 1 + geometry features
  int64_t grad_color;                      // 3, before the sigmoid
  int64_t shade_unit, shade_fade;          // 3 N and N, coordinates and fading of the shade encoding
  int64_t shade_each;                      // its features of one key point
  int64_t pull;                            // 1: factor on the ambient coordinates that is added to their gradient
  int64_t chosen;                          // 1: positive where the sample goes on to the next pass
  int64_t count;                           // of all rows

  int64_t num_features, ambient_features, canonical_features, local_features, shade_features;

  // What the density pass leaves of each sample for the passes to come, and what the way back needs.
  std::vector<RowRange> for_gradients, for_pictures, for_backward;
};

}  // namespace editnerf
