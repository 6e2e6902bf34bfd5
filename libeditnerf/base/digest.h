// A short digest of bytes, by which a cache sees that its input has changed: FNV-1a, 64 bits (Fowler, Noll, Vo). Not
// against anyone who means to deceive it.
#pragma once

#include <ATen/ATen.h>

#include <cstdint>
#include <string>

namespace editnerf {

class Digest {
 public:
  void Add(const void* data, size_t size);
  void Add(const at::Tensor& tensor);  // its sizes, and its values as they lie in memory when contiguous on the CPU

  std::string Text() const;  // 16 hexadecimal digits

 private:
  uint64_t state_ = 0xcbf29ce484222325;
};

}  // namespace editnerf
