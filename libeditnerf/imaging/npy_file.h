// NumPy's .npy files (versions 1 to 3, little endian, C order) as tensors.
#pragma once

#include <torch/types.h>

#include <filesystem>

namespace editnerf {

// float32, float64, int8, int16, int32, int64, uint8 and bool keep their type; uint16 and uint32 arrive as the next
// wider signed type. On the CPU. Throws DataError naming the file and what it found for anything else: another file
// type, Fortran order, big endian, pickled objects, a damaged header, or data whose size does not match the header.
torch::Tensor ReadNpy(const std::filesystem::path& path, uintmax_t max_bytes = uintmax_t{1} << 33);

// The types above without the unsigned 16 and 32 bit ones; atomic. Throws ShapeError for other types.
void WriteNpy(const std::filesystem::path& path, const torch::Tensor& array);

}  // namespace editnerf
