// A tile: some samples of rays and everything that the fast field computes for them, feature by feature.
//
// Every quantity is a row of kTile floats, one for each sample, and consecutive rows lie kTileStride floats apart. So
// everything that is the same for all samples runs down a vector of samples, a layer of a small network is a product
// with its weights as they are, and a tile of 300 rows stays in the second-level cache. Columns past the tile's samples
// hold finite rubbish: kernels compute whole vectors of them, and nothing reads the result.
#pragma once

#include <algorithm>
#include <cstdint>
#include <cstdlib>
#include <memory>
#include <new>

namespace editnerf {

constexpr int64_t kTile = 128;  // samples; a multiple of every vector
// Room for one vector behind the samples, where compaction may spill; and an odd number of cache lines, so that the
// rows of a tile spread over all sets of the cache.
constexpr int64_t kTileStride = 144;

// Samples rounded up to whole vectors, whatever their width.
inline int64_t PaddedSamples(int64_t count) { return (count + 15) / 16 * 16; }

inline float* TileRow(float* rows, int64_t row) { return rows + row * kTileStride; }
inline const float* TileRow(const float* rows, int64_t row) { return rows + row * kTileStride; }

// Memory for some rows, all zero at first, and for the fifteen behind them that kernels working on sixteen rows at a
// time may read.
class TileMemory {
 public:
  explicit TileMemory(int64_t num_rows) {
    const size_t floats = static_cast<size_t>((num_rows + 15) * kTileStride);
    memory_.reset(static_cast<float*>(std::aligned_alloc(64, floats * sizeof(float))));
    if (memory_ == nullptr) throw std::bad_alloc();
    std::fill_n(memory_.get(), floats, 0.0F);
  }

  float* rows() { return memory_.get(); }
  const float* rows() const { return memory_.get(); }
  float* Row(int64_t row) { return TileRow(memory_.get(), row); }
  const float* Row(int64_t row) const { return TileRow(memory_.get(), row); }

 private:
  struct Free {
    void operator()(float* memory) const { std::free(memory); }
  };
  std::unique_ptr<float[], Free> memory_;
};

}  // namespace editnerf
