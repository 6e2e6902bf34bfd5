// Memory that begins at a cache line.
#pragma once

#include <algorithm>
#include <cstddef>
#include <vector>

namespace editnerf {

// Room for `size` trivial values, 0 at first.
template <class T>
class AlignedMemory {
 public:
  AlignedMemory() = default;
  explicit AlignedMemory(size_t size) : lines_((size * sizeof(T) + kLine - 1) / kLine), size_(size) {}

  // Room for at least that many; what was there is lost where it grows.
  void Reserve(size_t size) {
    if (size > size_) *this = AlignedMemory(size);
  }
  void Clear() { std::fill(lines_.begin(), lines_.end(), Line{}); }

  size_t size() const { return size_; }
  T* data() { return reinterpret_cast<T*>(lines_.data()); }
  const T* data() const { return reinterpret_cast<const T*>(lines_.data()); }

 private:
  static constexpr size_t kLine = 64;
  struct alignas(kLine) Line {
    std::byte bytes[kLine] = {};
  };
  std::vector<Line> lines_;
  size_t size_ = 0;
};

}  // namespace editnerf
