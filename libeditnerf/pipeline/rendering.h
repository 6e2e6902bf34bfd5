// From a request (frames, a camera path, an edit) to pictures and videos of a run.
//
// Planning names every output picture, its camera and its state, and meets all the user's mistakes; rendering then only
// renders.
#pragma once

#include <torch/types.h>

#include <cstdint>
#include <filesystem>
#include <string>
#include <vector>

#include "libeditnerf/editing/edit_file.h"
#include "libeditnerf/field/radiance_field.h"
#include "libeditnerf/geometry/camera.h"
#include "libeditnerf/training/run.h"

namespace editnerf {

struct PlannedFrame {
  std::string name;    // of the picture's file, without its ending
  Camera camera;       // scene units
  FrameStates states;  // tables of one row, on the run's device
};

struct RenderJob {
  std::vector<PlannedFrame> frames;
  double fps = 24;             // of a video
  bool unseen_states = false;  // edits: training may never have shown these states
};

// Scene frames as they are: `selection` is "train", "val", "all" (both) or ids separated by commas. Throws DataError
// for unknown ids, and for frames of the edit split: a run has no state of theirs.
RenderJob PlanFrames(const Run& run, const std::string& selection);

// One picture for each camera file (*.json, world units, in order of name) of `folder`, all in the state of one frame;
// empty: the middle training frame. Throws DataError where the folder has no cameras, and as PlanFrames does.
RenderJob PlanCameraPath(const Run& run, const std::filesystem::path& folder, const std::string& code_frame = "");

// The frames of an edit (docs/edit-files.md), named by their number. Throws DataError naming the frame of the edit: for
// a pretrained run, which has no key points, a key point that the run does not have, an unknown frame id.
RenderJob PlanEdit(const Run& run, const EditFile& edit);

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
