// What the fast field does to whole rows of a tile (tile.h) between its matrix products and table look-ups. SIMD chosen
// at run time (Highway). `count` samples, rounded up to whole vectors; rows may not overlap unless they are the same.
#pragma once

#include <cstdint>

#include "libeditnerf/kernels/tile.h"

namespace editnerf {

// x [3 rows] scene units -> unit [3 rows], (x - low) / side clamped to [0, 1]; a NaN becomes 0.
void UnitCoordinates(const float* x, const float low[3], float side, int64_t count, float* unit);

// unit [3 rows] = clamp((x - anchor) / side + 1/2), and fade [1 row]: 1 inside the cube around the anchor, down to 0 at
// its faces over `margin` of its half side. anchor nullptr: 0.
void LocalCoordinates(const float* x, const float* anchor, float side, float margin, int64_t count, float* unit,
                      float* fade);

// rows [num_rows] *= factor [1 row].
void ScaleRows(const float* factor, int64_t num_rows, int64_t count, float* rows);
// rows [num_rows] *= factor.
void ScaleRows(float factor, int64_t num_rows, int64_t count, float* rows);

// Positional encoding (field/positional_encoding.h): x [dim rows] -> [dim * (1 + 2 octaves) rows], all times `window`.
void EncodeTile(const float* x, int64_t dim, int64_t octaves, float window, int64_t count, float* out);
// grad_x [dim rows] = the encoding's transposed Jacobian times grad, given what EncodeTile wrote.
void EncodeTileGradient(const float* out, const float* grad, int64_t dim, int64_t octaves, float window, int64_t count,
                        float* grad_x);

// density = exp(clamp(x + bias, -limit, limit)), one row.
void DensityOf(const float* x, float bias, float limit, int64_t count, float* density);

// rows <- 1 / (1 + exp(-rows)).
void Sigmoid(int64_t num_rows, int64_t count, float* rows);

// logits [num rows] -= scale * distance from x [3 rows] to the nearest of anchors [num, per, 3].
void SubtractDistances(const float* x, const float* anchors, int64_t num, int64_t per, float scale, int64_t count,
                       float* logits);

// rows <- softmax over the rows, sample by sample.
void Softmax(int64_t num_rows, int64_t count, float* rows);
// grad [num rows]: with respect to the weights in, with respect to the logits out.
void SoftmaxGradient(const float* weights, int64_t num_rows, int64_t count, float* grad);

// anchor [3 rows] = sum_i w_i k_i and ambient [3 rows] = sum_i w_i (scale_i k_i + offset_i), for weights [num rows] and
// keys [3 num rows], by key point and then axis.
void WeightedSum(const float* weights, const float* keys, const float* scale, const float* offset, int64_t num,
                 int64_t count, float* anchor, float* ambient);
// Its gradient: grad_weights [num rows], grad_keys [3 num rows].
void WeightedSumGradient(const float* weights, const float* keys, const float* scale, const float* offset, int64_t num,
                         int64_t count, const float* grad_anchor, const float* grad_ambient, float* grad_weights,
                         float* grad_keys);

// turned [3 rows] = sum_i w_i R_i (x - k_i), for weights [num rows], keys [3 num rows] and frames [9 num rows], R by
// rows. weights nullptr: 1.
void SumInFrames(const float* x, const float* weights, const float* keys, const float* frames, int64_t num,
                 int64_t count, float* turned);
// Its gradient, given `grad` [3 rows]: added to grad_weights [num rows] (may be nullptr) and grad_keys [3 num rows],
// written to grad_frames [9 num rows].
void SumInFramesGradient(const float* x, const float* weights, const float* keys, const float* frames, int64_t num,
                         int64_t count, const float* grad, float* grad_weights, float* grad_keys, float* grad_frames);

// sum [num rows] = a + factor b.
void AddRows(const float* a, const float* b, float factor, int64_t num_rows, int64_t count, float* sum);
// sum [num rows] += factor [1 row] * rows.
void AddScaledRows(const float* factor, const float* rows, int64_t num_rows, int64_t count, float* sum);

// Flat arrays, count rounded up to 16: light[i] = exp(-before[i]), and 0 beyond e^-80; weight[i] = light[i]
// (1 - exp(-tau[i])).
void LightAlongRays(const float* tau, const float* before, int64_t count, float* light, float* weight);

}  // namespace editnerf
