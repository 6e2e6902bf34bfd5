// From a request (frames, a camera path, an edit) to the list of pictures to render: each one's name, camera and state.
// All the user's mistakes are met here; rendering (pipeline/rendering.h) then only renders.
#pragma once

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

// The camera with images of another size; 0: as the camera says. One of the sides alone keeps the aspect ratio.
Camera WithSize(const Camera& camera, int64_t width, int64_t height);

}  // namespace editnerf
