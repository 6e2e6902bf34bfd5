// Single image files as tensors.
#pragma once

#include <torch/types.h>

#include <filesystem>

namespace editnerf {

// Any format that OpenCV decodes (PNG, JPEG, ...) -> uint8 [H, W, 3], RGB. Grey images are repeated, transparency is
// dropped, 16 bits are brought to 8, and the orientation that a camera noted in the file is applied.
// Throws DataError naming the file where it is missing or cannot be decoded.
torch::Tensor ReadImage(const std::filesystem::path& path);

// One channel of 8 bits, unchanged -> uint8 [H, W]. Throws DataError where the file has another kind of pixels.
torch::Tensor ReadMask(const std::filesystem::path& path);

// uint8 [H, W, 3] RGB or [H, W]; on any device. Atomic. Throws ShapeError, or DataError where writing fails.
void WritePng(const std::filesystem::path& path, const torch::Tensor& image);

// Area-averaged (anti-aliased) uint8 [H, W, 3] or [H, W] -> the new size. Meant for shrinking.
torch::Tensor ResizeByArea(const torch::Tensor& image, int64_t new_height, int64_t new_width);

// Whether the name's ending is one of an image that ReadImage is expected to read (.png, .jpg, .jpeg, .bmp, .tif,
// .tiff, .webp; any case).
bool HasImageExtension(const std::filesystem::path& path);

}  // namespace editnerf
