// The part of Python's pickle language that stores of tensors need. Nothing is executed: a pickle's "globals" are
// looked up in the fixed list below, and each is a data type or a way to describe a tensor, never a function.
//
//   collections.OrderedDict, torch._utils._rebuild_tensor_v2, torch._utils._rebuild_parameter,
//   torch.{Float,Double,Half,BFloat16,Long,Int,Short,Char,Byte,Bool}Storage
//
// Values live in one arena and refer to each other by index, so a hostile file can neither recurse nor leak; there are
// at most as many as the pickle has bytes.
#pragma once

#include <torch/types.h>

#include <cstdint>
#include <deque>
#include <string>
#include <string_view>
#include <vector>

namespace editnerf {

enum class PickleGlobal { kOrderedDict, kRebuildTensor, kRebuildParameter, kStorageType };

struct PickleValue {
  enum class Kind { kNone, kBool, kInt, kFloat, kString, kTuple, kList, kDict, kGlobal, kStorage, kTensor };

  Kind kind = Kind::kNone;
  int64_t integer = 0;        // kBool, kInt; kStorage: number of elements; kTensor: storage offset in elements
  double real = 0;            // kFloat
  std::string text;           // kString; kGlobal: its full name; kStorage: its key
  std::vector<size_t> items;  // kTuple, kList; kDict: key, value, key, value, ...; kTensor: the storage alone
  PickleGlobal global = PickleGlobal::kOrderedDict;  // kGlobal
  torch::ScalarType type = torch::kFloat;            // kGlobal of a storage type; kStorage
  std::vector<int64_t> sizes, strides;               // kTensor; inside its storage, by what the pickle says of both
};

const char* KindName(PickleValue::Kind kind);  // "a dict", "a tensor", ...

struct Pickle {
  std::deque<PickleValue> values;
  size_t root = 0;    // index of the value that the pickle describes
  size_t length = 0;  // bytes read, up to and including its STOP

  const PickleValue& Root() const { return values[root]; }
};

// Reads the pickle at the start of `bytes`. Throws DataError, beginning with "name: ", at a truncated or inconsistent
// stream, at an opcode that tensor files do not need, and at a global that is not in the list (named, with the list).
Pickle ReadPickle(std::string_view bytes, const std::string& name);

}  // namespace editnerf
