#include "libeditnerf/base/shape.h"

#include "libeditnerf/base/error.h"

namespace editnerf {
namespace {

std::string Join(const int64_t* sizes, size_t count) {
  std::string text = "[";
  for (size_t i = 0; i < count; ++i) {
    if (i > 0) text += ", ";
    text += sizes[i] == kAny ? "*" : std::to_string(sizes[i]);
  }
  return text + "]";
}

}  // namespace

std::string ShapeString(const at::Tensor& tensor) {
  if (!tensor.defined()) return "undefined";
  return Join(tensor.sizes().data(), tensor.sizes().size());
}

void CheckShape(const at::Tensor& tensor, std::initializer_list<int64_t> expected, const char* name) {
  bool matches = tensor.defined() && tensor.dim() == static_cast<int64_t>(expected.size());
  int64_t axis = 0;
  for (const int64_t size : expected) {
    if (!matches) break;
    matches = size == kAny || tensor.size(axis) == size;
    ++axis;
  }
  if (!matches) {
    Throw<ShapeError>("{}: expected shape {}, found {}", name, Join(expected.begin(), expected.size()),
                      ShapeString(tensor));
  }
}

void CheckLastDim(const at::Tensor& tensor, int64_t expected, const char* name) {
  if (!tensor.defined() || tensor.dim() == 0 || tensor.size(-1) != expected) {
    Throw<ShapeError>("{}: expected a last dimension of {}, found {}", name, expected, ShapeString(tensor));
  }
}

}  // namespace editnerf
