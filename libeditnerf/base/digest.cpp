#include "libeditnerf/base/digest.h"

#include <fmt/format.h>

namespace editnerf {

void Digest::Add(const void* data, size_t size) {
  const auto* bytes = static_cast<const unsigned char*>(data);
  for (size_t i = 0; i < size; ++i) state_ = (state_ ^ bytes[i]) * 0x100000001b3;
}

void Digest::Add(const at::Tensor& tensor) {
  for (const int64_t size : tensor.sizes()) Add(&size, sizeof size);
  const at::Tensor values = tensor.cpu().contiguous();
  Add(values.data_ptr(), values.nbytes());
}

std::string Digest::Text() const { return fmt::format("{:016x}", state_); }

}  // namespace editnerf
