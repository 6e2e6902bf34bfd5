// The images of a scene folder at the size that a run asks for.
#pragma once

#include <torch/types.h>

#include <filesystem>
#include <string>
#include <vector>

#include "libeditnerf/config/config.h"

namespace editnerf {

// config.image_factor, or, where that is 0, the smallest factor that brings the longer side to max_side or below.
int64_t ImageFactor(const DataConfig& config, int64_t full_width, int64_t full_height);

// uint8 [F, H, W, 3], one image per id, decoded by several threads. For a factor above 1, rgb/<factor>x/ID.png is used
// where it is there and has the right size; otherwise rgb/1x/ID.png is area-averaged in memory. H and W are the full
// size over the factor, rounded (or within a pixel of it, as the files of rgb/<factor>x have it). Throws DataError
// naming the file that is missing, cannot be decoded or has another size.
torch::Tensor ReadSceneImages(const std::filesystem::path& folder, const std::vector<std::string>& ids,
                              int64_t full_width, int64_t full_height, int64_t factor);

// Nearest-neighbour resizing of [..., H, W] in the last two dimensions, any type, pixel centres at +0.5.
torch::Tensor ResizeByNearest(const torch::Tensor& images, int64_t new_height, int64_t new_width);

}  // namespace editnerf
