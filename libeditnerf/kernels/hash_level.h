// One level of the hash encoding over some samples, for float32 and two features per entry: the case that runs. SIMD
// chosen at run time (Highway). hash_encoding.cpp has the same for other types, and the formula.
#pragma once

#include <cstdint>

namespace editnerf {

constexpr int64_t kHashTile = 128;  // samples at most

// Coordinates already clamped to [0, 1] and free of NaN, also those that fill up the last 16.
struct HashPoints {
  int64_t count = 0;
  const float* x[3];
};

struct HashLevel {
  int64_t resolution = 1;  // cells per axis, at most 2^22: a float32 cannot name more
  int64_t table_size = 1;  // entries, a power of two
};

// features [table_size, 2] -> out0[s] and out1[s] of every sample, written in whole vectors of 16.
void EncodeHashLevel(const HashPoints& points, const HashLevel& level, const float* features, float* out0, float* out1);

// Adds the gradient of the entries, given grad0[s] and grad1[s].
void ScatterHashLevel(const HashPoints& points, const HashLevel& level, const float* grad0, const float* grad1,
                      float* grad_features);

// Adds the gradient of the coordinates to slope[axis][s], also where they were clamped; in whole vectors of 16.
void SlopeHashLevel(const HashPoints& points, const HashLevel& level, const float* features, const float* grad0,
                    const float* grad1, float* const slope[3]);

// Tables in bfloat16: an entry is a word, its first feature in the lower half, and the first entry follows the last
// once more, so that both ends of an edge always lie side by side.
constexpr int64_t kBf16TablePadding = 16;  // words behind a level's entries, of which the first is used

// features [table_size, 2], rounded to the nearest -> entries [table_size + kBf16TablePadding].
void PackHashEntries(const float* features, int64_t table_size, uint32_t* entries);

// As EncodeHashLevel and SlopeHashLevel, from such entries.
void EncodeBf16HashLevel(const HashPoints& points, const HashLevel& level, const uint32_t* entries, float* out0,
                         float* out1);
void SlopeBf16HashLevel(const HashPoints& points, const HashLevel& level, const uint32_t* entries, const float* grad0,
                        const float* grad1, float* const slope[3]);

}  // namespace editnerf
