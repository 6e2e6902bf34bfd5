// A hash table's copy in bfloat16: half the memory to look up in, and so fewer misses of the caches.
#pragma once

#include <ATen/core/Tensor.h>

#include <cstdint>
#include <mutex>

#include "libeditnerf/kernels/aligned_memory.h"
#include "libeditnerf/kernels/hash_level.h"

namespace editnerf {

// Threads may refresh it together, as long as nobody changes the table meanwhile.
class Bf16Table {
 public:
  // Copies a table [L, T, 2], float32 and contiguous on the CPU, unless it is as it was: whoever changes one past
  // LibTorch's operations raises its version, as Adam does.
  void Refresh(const at::Tensor& table);

  const uint32_t* Level(int64_t level) const { return entries_.data() + level * (table_size_ + kBf16TablePadding); }

 private:
  std::mutex mutex_;
  at::Tensor source_;  // held, so that no other table comes to lie in its place
  const float* data_ = nullptr;
  uint32_t version_ = 0;
  int64_t table_size_ = 0;
  AlignedMemory<uint32_t> entries_;  // [L, T + kBf16TablePadding]
};

}  // namespace editnerf
