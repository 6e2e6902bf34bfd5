#include "libeditnerf/editing/edit_session.h"

#include <torch/types.h>
#include <torch/utils.h>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <utility>

#include "libeditnerf/base/error.h"

namespace editnerf {
namespace {

constexpr size_t kMaxUndo = 200;              // steps
constexpr size_t kMaxUndoKeyFrames = 50'000;  // in all of them
constexpr double kDepthRoom = 4;              // beyond near and far
constexpr double kMaxPixels = 1e5;            // beyond which a drag cannot be meant
constexpr double kMaxPosition = 1e3;          // scene units; a scene is about one wide

// What the cameras agree on: the opposite of their y axes.
Vec3 UpOf(const Scene& scene) {
  Vec3 sum;
  for (const int64_t frame : scene.train) sum += -scene.frames[static_cast<size_t>(frame)].camera.orientation.Row(1);
  return Norm(sum) > 1e-6 ? Normalized(sum) : Vec3{0, -1, 0};
}

}  // namespace

EditableScene MakeEditableScene(const Run& run) {
  if (run.stage == FieldStage::kPretrain) {
    Throw<DataError>("editor: this is a pretrained run, which has no key points to move; give the run of enf-train");
  }
  EditableScene scene;
  scene.scene = run.scene;
  scene.box = run.field->options().box;
  if (run.field->num_key_points() > 0) {
    const torch::NoGradGuard no_grad;
    const auto count = static_cast<int64_t>(run.scene.train.size());
    const auto rows = torch::arange(count, torch::TensorOptions(torch::kInt64).device(run.device));
    scene.tracks = KeyPointTracks(run.field->States(rows).key_points);
  }
  return scene;
}

EditSession::EditSession(std::shared_ptr<const EditableScene> scene) : scene_(std::move(scene)) {
  const Scene& frames = scene_->scene;
  state_.row = static_cast<int64_t>(frames.train.size()) / 2;
  if (scene_->tracks.num_key_points() > 0) state_.key_points = scene_->tracks.Row(state_.row);
  state_.depth_factors.assign(state_.key_points.size(), 1);
  orbit_.up = UpOf(frames);
  orbit_.nearest = frames.transform.near / kDepthRoom;
  orbit_.farthest = frames.transform.far * kDepthRoom;
  UseCaptureCamera(frames.train[static_cast<size_t>(state_.row)]);
}

double EditSession::Finite(double value, const char* what) {
  if (!std::isfinite(value)) Throw<DataError>("{}: expected a finite number, found {}", what, value);
  return value;
}

double EditSession::Positive(double value, const char* what) {
  if (!(value > 0) || !std::isfinite(value)) Throw<DataError>("{}: expected a positive number, found {}", what, value);
  return value;
}

size_t EditSession::Index(int64_t key_point) const {
  const auto count = static_cast<int64_t>(state_.key_points.size());
  if (key_point < 0 || key_point >= count) {
    Throw<DataError>("key point {}: the run has {}{}", key_point, count, count > 0 ? ", numbered from 0" : "");
  }
  return static_cast<size_t>(key_point);
}

int64_t EditSession::Row(int64_t row) const {
  const auto count = static_cast<int64_t>(scene_->scene.train.size());
  if (row < 0 || row >= count) {
    Throw<DataError>("training frame {}: the run has {}, numbered from 0", row, count);
  }
  return row;
}

// A change belongs to the last step that changed the same part, or to a later one, if that has its gesture.
template <class Part>
void EditSession::Remember(std::optional<Part> Step::*part, const Part& now, int64_t gesture) {
  redo_.clear();
  for (auto step = undo_.rbegin(); gesture != 0 && step != undo_.rend(); ++step) {
    if (step->gesture == gesture) {
      if (!(*step.*part)) *step.*part = now;
      return;
    }
    if (*step.*part) break;
  }
  Step& step = undo_.emplace_back();
  step.gesture = gesture;
  step.*part = now;
  size_t key_frames = 0, kept = 0;  // of the newest steps, as many as there is room for
  for (auto at = undo_.rbegin(); at != undo_.rend() && kept < kMaxUndo; ++at, ++kept) {
    if (at->trail) key_frames += at->trail->frames().size();
    if (key_frames > kMaxUndoKeyFrames && kept > 0) break;
  }
  undo_.erase(undo_.begin(), undo_.end() - static_cast<std::ptrdiff_t>(kept));
}

void EditSession::ChangeTrail(EditTrail changed, int64_t gesture) {
  Remember(&Step::trail, trail_, gesture);
  trail_ = std::move(changed);
}

double EditSession::DefaultDepth(size_t key_point, double u, double v) const {
  const auto known = scene_->tracks.DragDepth(orbit_.camera, static_cast<int64_t>(key_point), u, v);
  if (known) return *known;
  // Nothing of the trajectory is in front of the camera: the depth stays, or is that of what the camera turns around.
  const Projected now = Project(orbit_.camera, state_.key_points[key_point]);
  return now.valid ? now.depth : std::max(Norm(orbit_.target - orbit_.camera.position), orbit_.nearest);
}

void EditSession::PlaceAt(size_t key_point, double u, double v, double depth) {
  const SceneTransform& transform = scene_->scene.transform;
  depth = std::clamp(depth, transform.near / kDepthRoom, transform.far * kDepthRoom);
  const Camera& camera = orbit_.camera;
  const Vec3 direction = camera.DirectionThrough(u, v);
  state_.key_points[key_point] = camera.position + direction * (depth / Dot(direction, camera.orientation.Row(2)));
}

void EditSession::MoveToPixel(int64_t key_point, double u, double v, int64_t gesture) {
  const size_t n = Index(key_point);
  if (!(std::abs(u) <= kMaxPixels && std::abs(v) <= kMaxPixels)) {
    Throw<DataError>("key point {}: expected a pixel position, found {}, {}", key_point, u, v);
  }
  RememberState(gesture);
  PlaceAt(n, u, v, DefaultDepth(n, u, v) * state_.depth_factors[n]);
}

void EditSession::Nudge(int64_t key_point, double du, double dv, int64_t gesture) {
  const Projected now = Project(orbit_.camera, state_.key_points[Index(key_point)]);
  if (!now.valid) Throw<DataError>("key point {}: it lies behind the camera and cannot be nudged", key_point);
  MoveToPixel(key_point, now.u + du, now.v + dv, gesture);
}

void EditSession::ScaleDepth(int64_t key_point, double factor, int64_t gesture) {
  const size_t n = Index(key_point);
  Positive(factor, "depth factor");
  const Projected now = Project(orbit_.camera, state_.key_points[n]);
  if (!now.valid) Throw<DataError>("key point {}: it lies behind the camera, and so it has no depth", key_point);
  RememberState(gesture);
  PlaceAt(n, now.u, now.v, now.depth * factor);
  // What a drag would be at, had it ended here.
  const double depth = Project(orbit_.camera, state_.key_points[n]).depth;
  state_.depth_factors[n] = depth / DefaultDepth(n, now.u, now.v);
}

void EditSession::SetPosition(int64_t key_point, const Vec3& position, int64_t gesture) {
  const size_t n = Index(key_point);
  for (const double value : {position.x, position.y, position.z}) {
    if (!(std::abs(value) <= kMaxPosition)) {
      Throw<DataError>("key point {}: expected a position in scene units, up to {}, found {}", key_point, kMaxPosition,
                       value);
    }
  }
  RememberState(gesture);
  state_.key_points[n] = position;
  const Projected now = Project(orbit_.camera, position);
  state_.depth_factors[n] = now.valid ? now.depth / DefaultDepth(n, now.u, now.v) : 1;
}

void EditSession::Reset(int64_t key_point, int64_t gesture) {
  const size_t n = Index(key_point);
  RememberState(gesture);
  state_.key_points[n] = scene_->tracks.Row(state_.row)[n];
  state_.depth_factors[n] = 1;
}

void EditSession::ResetAll() { SnapTo(state_.row); }

void EditSession::SnapTo(int64_t row, int64_t gesture) {
  Row(row);
  RememberState(gesture);
  state_.row = row;
  if (!state_.key_points.empty()) state_.key_points = scene_->tracks.Row(row);
  state_.depth_factors.assign(state_.key_points.size(), 1);
}

void EditSession::Retrace(std::vector<Step>* from, std::vector<Step>* to) {
  Step step = std::move(from->back());
  from->pop_back();
  if (step.state) std::swap(*step.state, state_);
  if (step.trail) std::swap(*step.trail, trail_);
  to->push_back(std::move(step));
  for (Step& closed : undo_) closed.gesture = 0;  // whatever is done next is a new step
}

bool EditSession::Undo() {
  if (undo_.empty()) return false;
  Retrace(&undo_, &redo_);
  return true;
}

bool EditSession::Redo() {
  if (redo_.empty()) return false;
  Retrace(&redo_, &undo_);
  return true;
}

void EditSession::UseCaptureCamera(int64_t frame) {
  const auto& frames = scene_->scene.frames;
  if (frame < 0 || frame >= static_cast<int64_t>(frames.size())) {
    Throw<DataError>("camera {}: the run has {}, numbered from 0", frame, frames.size());
  }
  capture_camera_ = frame;
  orbit_.camera = frames[static_cast<size_t>(frame)].camera;
  if (scene_->tracks.num_key_points() > 0) {
    orbit_.target = scene_->tracks.Center();
  } else {
    const SceneTransform& transform = scene_->scene.transform;
    orbit_.target =
        orbit_.camera.position + orbit_.camera.orientation.Row(2) * (0.5 * (transform.near + transform.far));
  }
}

void EditSession::AddKeyFrame(double time, int64_t gesture) {
  EditTrail changed = trail_;
  changed.Add(Present(time));
  ChangeTrail(std::move(changed), gesture);
}

void EditSession::ReplaceKeyFrame(int64_t index, int64_t gesture) {
  EditTrail changed = trail_;
  changed.Replace(index, Present(0));
  ChangeTrail(std::move(changed), gesture);
}

void EditSession::MoveKeyFrame(int64_t index, double seconds, int64_t gesture) {
  EditTrail changed = trail_;
  changed.Move(index, seconds);
  ChangeTrail(std::move(changed), gesture);
}

void EditSession::RemoveKeyFrame(int64_t index, int64_t gesture) {
  EditTrail changed = trail_;
  changed.Remove(index);
  ChangeTrail(std::move(changed), gesture);
}

void EditSession::ClearTrail(int64_t gesture) {
  if (!trail_.frames().empty()) ChangeTrail({}, gesture);
}

void EditSession::ShowTrail(double seconds, int64_t gesture) {
  const TrailFrame shown = trail_.At(Finite(seconds, "time"));
  RememberState(gesture);
  state_.key_points = shown.key_points;
  state_.depth_factors.assign(state_.key_points.size(), 1);
  state_.row = shown.row;
  orbit_.camera = shown.camera;
}

Handle EditSession::HandleOf(int64_t key_point) const {
  const Vec3& position = state_.key_points[Index(key_point)];
  const Camera& camera = orbit_.camera;
  const Projected seen = Project(camera, position);
  Handle handle;
  handle.depth = seen.depth;
  handle.in_front = seen.valid;
  handle.reach = scene_->tracks.ReachOf(key_point, position);
  if (!seen.valid) return handle;
  handle.u = seen.u;
  handle.v = seen.v;
  handle.in_image = seen.u >= 0 && seen.v >= 0 && seen.u <= static_cast<double>(camera.width) &&
                    seen.v <= static_cast<double>(camera.height);
  return handle;
}

}  // namespace editnerf
