#include "libeditnerf/kernels/bf16_table.h"

#include "libeditnerf/base/parallel.h"

namespace editnerf {

void Bf16Table::Refresh(const at::Tensor& table) {
  const std::lock_guard<std::mutex> lock(mutex_);
  const float* const data = table.data_ptr<float>();
  const auto version = static_cast<uint32_t>(table._version());
  if (source_.is_same(table) && data == data_ && version == version_) return;
  source_ = table;
  data_ = data;
  version_ = version;
  table_size_ = table.size(1);
  entries_.Reserve(static_cast<size_t>(table.size(0) * (table_size_ + kBf16TablePadding)));
  uint32_t* const entries = entries_.data();
  const int64_t row = table_size_ + kBf16TablePadding;
  ParallelFor(table.size(0), 2, [&](int64_t begin, int64_t end) {
    for (int64_t l = begin; l < end; ++l) PackHashEntries(data + 2 * l * table_size_, table_size_, entries + l * row);
  });
}

}  // namespace editnerf
