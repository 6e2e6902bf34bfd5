// Named tensors in one file: the safetensors format, which Python and others read, and which holds nothing executable.
//
//   8 bytes   length n of the header, little-endian
//   n bytes   JSON {"__metadata__": {text: text}, name: {"dtype": "F32", "shape": [2, 3], "data_offsets": [begin,
//   end]}} the rest  the tensors' bytes, little-endian and row-major, without holes; offsets count from the header's
//   end
//
// dtypes: F64 F32 F16 BF16 I64 I32 I16 I8 U8 BOOL. Little-endian machines only.
#pragma once

#include <torch/types.h>

#include <filesystem>
#include <map>
#include <string>

namespace editnerf {

struct SafetensorsFile {
  std::map<std::string, torch::Tensor> tensors;  // on the CPU, contiguous
  std::map<std::string, std::string> metadata;
};

// Writes tensors of any device, layout and size (also empty and scalar ones) one after the other, so that no second
// copy of all of them is made. Atomic: after an error what was there before is still there. Throws DataError when the
// file cannot be written, CheckpointError for an undefined tensor, a dtype that the format does not have, a tensor
// called "__metadata__" or text that is not UTF-8.
void WriteSafetensors(const std::filesystem::path& path, const std::map<std::string, torch::Tensor>& tensors,
                      const std::map<std::string, std::string>& metadata = {});

// Throws CheckpointError naming the file, what was found and what was expected, when the file is missing, truncated or
// in any way not as described above. No more memory is reserved than the file has bytes.
SafetensorsFile ReadSafetensors(const std::filesystem::path& path);

// The metadata alone, without reading the tensors; throws as ReadSafetensors.
std::map<std::string, std::string> ReadSafetensorsMetadata(const std::filesystem::path& path);

}  // namespace editnerf
