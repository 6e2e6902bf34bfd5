// Shape checks at the modules' doors. The message names the tensor and both shapes.
#pragma once

#include <ATen/ATen.h>

#include <cstdint>
#include <initializer_list>
#include <string>

namespace editnerf {

constexpr int64_t kAny = -1;

// Throws ShapeError unless `tensor` is defined and its sizes match `expected`, where kAny matches every size.
void CheckShape(const at::Tensor& tensor, std::initializer_list<int64_t> expected, const char* name);

// Throws ShapeError unless `tensor` is defined, has a dimension, and its last one has size `expected`.
void CheckLastDim(const at::Tensor& tensor, int64_t expected, const char* name);

std::string ShapeString(const at::Tensor& tensor);  // "[4, 3]", or "undefined"

}  // namespace editnerf
