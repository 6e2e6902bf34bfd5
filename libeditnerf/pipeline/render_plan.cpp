#include "libeditnerf/pipeline/render_plan.h"

#include <torch/types.h>
#include <torch/utils.h>

#include <algorithm>
#include <cmath>
#include <sstream>

#include "libeditnerf/base/error.h"
#include "libeditnerf/editing/edited_key_points.h"
#include "libeditnerf/imaging/camera_file.h"
#include "libeditnerf/training/held_out.h"

namespace editnerf {
namespace {

namespace fs = std::filesystem;

int64_t FrameOf(const Scene& scene, const std::string& id, const std::string& where) {
  for (size_t i = 0; i < scene.frames.size(); ++i) {
    if (scene.frames[i].id == id) return static_cast<int64_t>(i);
  }
  Throw<DataError>("{}: no frame with id '{}'; the run has {} frames, '{}' to '{}'", where, id, scene.frames.size(),
                   scene.frames.front().id, scene.frames.back().id);
}

FrameStates StateOf(const Run& run, int64_t frame, const std::string& where) {
  const SceneFrame& wanted = run.scene.frames[static_cast<size_t>(frame)];
  if (wanted.warp_id < 0) {
    Throw<DataError>(
        "{}: frame '{}' is of the edit split, and a run has no state of such a frame; render it with an edit file that "
        "gives its key points",
        where, wanted.id);
  }
  return StatesOfFrames(*run.field, run.scene, {frame}, run.device);
}

FrameStates StateOfRow(const Run& run, int64_t row) {
  return run.field->States(torch::tensor({row}, torch::kInt64).to(run.device));
}

std::vector<int64_t> SelectedFrames(const Scene& scene, const std::string& selection) {
  if (selection == "train") return scene.train;
  if (selection == "val") return scene.val;
  std::vector<int64_t> frames;
  if (selection == "all") {
    frames = scene.train;
    frames.insert(frames.end(), scene.val.begin(), scene.val.end());
    std::sort(frames.begin(), frames.end());
    frames.erase(std::unique(frames.begin(), frames.end()), frames.end());
    return frames;
  }
  std::istringstream ids(selection);
  for (std::string id; std::getline(ids, id, ',');) {
    if (!id.empty()) frames.push_back(FrameOf(scene, id, "frames"));
  }
  return frames;
}

// The state of an edit's frame. `tracks` [T, N, 3], undefined without key points.
FrameStates EditedState(const Run& run, const EditFrame& frame, const torch::Tensor& tracks, const std::string& where) {
  const int64_t count = run.field->num_key_points();
  bool any = false;
  for (size_t i = 0; i < frame.key_points.size(); ++i) {
    if (!frame.key_points[i]) continue;
    any = true;
    if (static_cast<int64_t>(i) < count) continue;
    Throw<DataError>("{}.key_points[{}]: the run has {} key points{}", where, i, count,
                     count > 0 ? ", numbered from 0" : ": it was trained as a static scene");
  }
  if (frame.code_frame.empty() && !any) {
    Throw<DataError>("{}: names neither a key point position nor a code_frame; give at least one", where);
  }
  FrameStates states = frame.code_frame.empty()
                           ? StateOfRow(run, NearestKeyPoints(frame.key_points, tracks).row)
                           : StateOf(run, FrameOf(run.scene, frame.code_frame, where + ".code_frame"), where);
  if (any) states.key_points = EditedKeyPoints(frame.key_points, states.key_points[0]).unsqueeze(0);
  return states;
}

Camera EditCamera(const Run& run, const EditFrame& frame, const std::string& where) {
  if (frame.camera) return CameraInSceneUnits(*frame.camera, run.scene.transform);
  const int64_t index = FrameOf(run.scene, frame.camera_frame, where + ".camera");
  return run.scene.frames[static_cast<size_t>(index)].camera;
}

}  // namespace

Camera WithSize(const Camera& camera, int64_t width, int64_t height) {
  if (width <= 0 && height <= 0) return camera;
  const double aspect = static_cast<double>(camera.width) / static_cast<double>(camera.height);
  const auto side = [](double pixels) { return std::max<int64_t>(1, std::llround(pixels)); };
  if (width <= 0) width = side(static_cast<double>(height) * aspect);
  if (height <= 0) height = side(static_cast<double>(width) / aspect);
  return camera.Resized(width, height);
}

RenderJob PlanFrames(const Run& run, const std::string& selection) {
  const torch::NoGradGuard no_grad;
  RenderJob job;
  for (const int64_t index : SelectedFrames(run.scene, selection)) {
    const SceneFrame& frame = run.scene.frames[static_cast<size_t>(index)];
    job.frames.push_back({frame.id, frame.camera, StateOf(run, index, "frames")});
  }
  if (job.frames.empty()) {
    Throw<DataError>("frames: '{}' selects none; expected train, val, all or ids separated by commas", selection);
  }
  return job;
}

RenderJob PlanCameraPath(const Run& run, const fs::path& folder, const std::string& code_frame) {
  const torch::NoGradGuard no_grad;
  if (!fs::is_directory(folder)) Throw<DataError>("{}: expected a folder of camera files", folder.string());
  std::vector<fs::path> files;
  for (const auto& entry : fs::directory_iterator(folder)) {
    if (entry.path().extension() == ".json") files.push_back(entry.path());
  }
  if (files.empty()) Throw<DataError>("{}: no camera files (*.json) here", folder.string());
  std::sort(files.begin(), files.end());
  const FrameStates states = code_frame.empty()
                                 ? StateOfRow(run, static_cast<int64_t>(run.scene.train.size() / 2))
                                 : StateOf(run, FrameOf(run.scene, code_frame, "code frame"), "code frame");
  RenderJob job;
  for (const fs::path& file : files) {
    const Camera camera = CameraInSceneUnits(ReadCameraFile(file), run.scene.transform);
    job.frames.push_back({file.stem().string(), camera, states});
  }
  return job;
}

RenderJob PlanEdit(const Run& run, const EditFile& edit) {
  if (run.stage == FieldStage::kPretrain) {
    Throw<DataError>("edit: this is a pretrained run, which has no key points to move; give the run of enf-train");
  }
  const torch::NoGradGuard no_grad;
  torch::Tensor tracks;
  if (run.field->num_key_points() > 0) {
    const auto count = static_cast<int64_t>(run.scene.train.size());
    tracks = run.field->States(torch::arange(count, torch::TensorOptions(torch::kInt64).device(run.device))).key_points;
  }
  RenderJob job;
  job.fps = edit.fps;
  job.unseen_states = true;
  for (size_t i = 0; i < edit.frames.size(); ++i) {
    const std::string where = fmt::format("edit: frames[{}]", i);
    const Camera camera = WithSize(EditCamera(run, edit.frames[i], where), edit.width, edit.height);
    job.frames.push_back({fmt::format("{:05}", i), camera, EditedState(run, edit.frames[i], tracks, where)});
  }
  return job;
}

}  // namespace editnerf
