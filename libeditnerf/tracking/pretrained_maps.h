// What the pretraining stage hands to key point detection: a surface map for every training frame.
#pragma once

#include <torch/types.h>

#include <filesystem>

#include "libeditnerf/scene/scene.h"

namespace editnerf {

// T training frames in time order (the rows of scene.train), H x W pixels of scene.images, A ambient dimensions.
struct PretrainedMaps {
  torch::Tensor depth;        // [T, H, W] float32, median depth along the ray, scene units; NaN: no surface
  torch::Tensor ambient;      // [T, H, W, A] float32, at the surface point of median depth
  torch::Tensor x_canonical;  // [T, H, W, 3] float32, scene units; undefined: the same as the observed surface point

  // Throws DataError naming the map whose size does not fit the scene's training images.
  void Check(const Scene& scene) const;
};

// run_folder/surface_maps.safetensors, with the training ids in its metadata. Reading checks that they are the scene's
// training ids in the same order and throws DataError otherwise.
PretrainedMaps ReadPretrainedMaps(const std::filesystem::path& run_folder, const Scene& scene);
void WritePretrainedMaps(const PretrainedMaps& maps, const Scene& scene, const std::filesystem::path& run_folder);

// Observed surface points of one frame's depth map [H, W] -> [H, W, 3] float32, scene units; NaN where it is NaN.
torch::Tensor SurfacePoints(const Camera& camera, const torch::Tensor& depth);

}  // namespace editnerf
