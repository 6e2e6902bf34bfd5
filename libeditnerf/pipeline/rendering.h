// From a planned job (pipeline/render_plan.h) to pictures and videos of a run.
#pragma once

#include <torch/types.h>

#include <cstdint>
#include <filesystem>
#include <string>

#include "libeditnerf/pipeline/render_plan.h"
#include "libeditnerf/training/run.h"

namespace editnerf {

struct RenderOutput {
  std::filesystem::path path;     // *.mp4: a video; otherwise a folder for NAME.png, NAME_depth.png, NAME_weights.png
  bool depth = false;             // near is bright, on one scale for the whole job; black: no surface
  bool weights = false;           // the key points' colours mixed by their weights, shaded like the picture
  int64_t width = 0, height = 0;  // pixels; 0: as the cameras say. One of them alone keeps the aspect ratio
  double fps = 0;                 // of a video; 0: as the job says
};

// Pictures of depth and weights beside a video: "clip.mp4" -> "clip_depth.mp4".
std::filesystem::path BesideVideo(const std::filesystem::path& video, const std::string& suffix);

// Renders the job in order. For unseen states the occupancy grids are widened first. Throws DataError before anything
// is rendered: an empty job, pictures of several sizes for a video, weights of a run without key points; and
// Interrupted after Ctrl-C, where finished PNGs stay and an unfinished video leaves nothing.
void RenderFrames(const Run& run, const RenderJob& job, const RenderOutput& output);

// rgb [H, W, 3] floating point, [0, 1], clamped -> uint8 on the CPU.
torch::Tensor ToBytes(const torch::Tensor& rgb);

// depth [H, W], NaN where there is no surface -> uint8 [H, W, 3]; from `near` (bright) to `far` (dark).
torch::Tensor DepthPicture(const torch::Tensor& depth, double near, double far);

// weights [H, W, N], or undefined for one key point; rgb [H, W, 3]; surface [H, W] bool: elsewhere the picture is grey.
torch::Tensor WeightPicture(const torch::Tensor& weights, const torch::Tensor& rgb, const torch::Tensor& surface);

}  // namespace editnerf
