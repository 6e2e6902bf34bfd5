// A whole scene in one file, so that a machine without OpenCV can train, render and measure it.
//
// A safetensors file with the metadata "format" = "editnerf-scene", "version" = "1" and "scene" = JSON {"name",
// "scale", "center": [3], "near", "far", "ids": [F texts], "objects": [O texts]}, and the tensors (F frames, scene
// units)
//   images              U8  [F, H, W, 3]
//   camera.orientation  F64 [F, 3, 3]     camera.position    F64 [F, 3]
//   camera.intrinsics   F64 [F, 5]        focal length, principal point (2), skew, pixel aspect ratio
//   camera.distortion   F64 [F, 5]        radial (3), tangential (2)
//   frame.warp_id       I64 [F]           frame.appearance_id  I64 [F]
//   split.train, split.val, split.edit    I64 [any]
//   points              F32 [P, 3]        only if known
//   truth.scene_from_object  F64 [F, O, 4, 4], truth.depth  F32 [F, H, W], truth.mask  U8 [F, H, W]    only if
//   synthetic
#pragma once

#include <filesystem>

#include "libeditnerf/scene/scene.h"

namespace editnerf {

// Throws DataError when the scene is inconsistent (Scene::Check) or the file cannot be written; the old file stays.
void SavePackedScene(const Scene& scene, const std::filesystem::path& path);

// Throws DataError naming the file and what is missing, of another shape or type, or inconsistent.
Scene LoadPackedScene(const std::filesystem::path& path);

}  // namespace editnerf
