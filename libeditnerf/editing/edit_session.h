// One person's edit of a run: where the key points are, from where they are seen, what can be undone, and the trail.
//
// No pictures are made here, and nothing of it is about the web. Key points are numbered from 0; pixels are those of
// the camera's own image size; everything is in scene units. Methods that change key points or the trail take a
// gesture: changes with the same gesture other than 0 are undone in one step, such as all the moves of one drag, or all
// key frames of a recording with the drags of key points in between in steps of their own. The camera is not part of
// what is undone. Not thread-safe. All mistakes are DataErrors that say what was expected.
#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "libeditnerf/editing/edit_trail.h"
#include "libeditnerf/editing/key_point_tracks.h"
#include "libeditnerf/editing/orbit_camera.h"
#include "libeditnerf/geometry/box.h"
#include "libeditnerf/scene/scene.h"
#include "libeditnerf/training/run.h"

namespace editnerf {

// What all sessions of a run have in common.
struct EditableScene {
  Scene scene;  // cameras, splits and units; no images
  KeyPointTracks tracks;
  Box box;
};

// Throws DataError for a pretrained run, which has no key points.
EditableScene MakeEditableScene(const Run& run);

struct EditState {
  std::vector<Vec3> key_points;
  std::vector<double> depth_factors;  // of the default depth of a drag; 1 where the user left the depth alone
  int64_t row = 0;                    // of the training frames: whose codes are used and where key points return to
};

// A key point as the picture shows it.
struct Handle {
  double u = 0, v = 0;  // pixels; 0 behind the camera
  double depth = 0;     // along the optical axis
  bool in_front = false, in_image = false;
  Reach reach;
};

class EditSession {
 public:
  explicit EditSession(std::shared_ptr<const EditableScene> scene);  // starts at the middle training frame

  // To pixel (u, v), at the default depth of a drag times the key point's depth factor.
  void MoveToPixel(int64_t key_point, double u, double v, int64_t gesture = 0);
  void Nudge(int64_t key_point, double du, double dv, int64_t gesture = 0);  // the same, by pixels

  // Along the ray through the key point. factor > 0; the depth stays between a quarter of the scene's near and four
  // times its far distance.
  void ScaleDepth(int64_t key_point, double factor, int64_t gesture = 0);

  void SetPosition(int64_t key_point, const Vec3& position, int64_t gesture = 0);
  void Reset(int64_t key_point, int64_t gesture = 0);  // to where the training frame state().row has it
  void ResetAll();
  void SnapTo(int64_t row, int64_t gesture = 0);  // key points and codes of a training frame

  // Each returns false where there is nothing to undo or redo.
  bool Undo();
  bool Redo();
  bool can_undo() const { return !undo_.empty(); }
  bool can_redo() const { return !redo_.empty(); }

  void UseCaptureCamera(int64_t frame);  // index into scene().frames
  void ResetCamera() { UseCaptureCamera(capture_camera_); }
  void Orbit(double right, double over) { orbit_.Orbit(Finite(right, "orbit"), Finite(over, "orbit")); }
  void Pan(double du, double dv) { orbit_.Pan(Finite(du, "pan"), Finite(dv, "pan")); }
  void Zoom(double factor) { orbit_.Zoom(Positive(factor, "zoom")); }

  // The trail: the present state as a key frame at this time, in seconds; key points, codes and camera of the trail at
  // a time after its start; and what EditTrail can do with key frames, `index` numbered from 0.
  void AddKeyFrame(double time, int64_t gesture = 0);
  void ShowTrail(double seconds, int64_t gesture = 0);
  void ReplaceKeyFrame(int64_t index, int64_t gesture = 0);  // by the present state
  void MoveKeyFrame(int64_t index, double seconds, int64_t gesture = 0);
  void RemoveKeyFrame(int64_t index, int64_t gesture = 0);
  void ClearTrail(int64_t gesture = 0);

  const EditableScene& scene() const { return *scene_; }
  const EditState& state() const { return state_; }
  const Camera& camera() const { return orbit_.camera; }
  int64_t capture_camera() const { return capture_camera_; }  // the last one that was chosen
  const EditTrail& trail() const { return trail_; }
  Handle HandleOf(int64_t key_point) const;

 private:
  // What a gesture has changed, as it was before.
  struct Step {
    int64_t gesture = 0;
    std::optional<EditState> state;
    std::optional<EditTrail> trail;
  };

  static double Finite(double value, const char* what);
  static double Positive(double value, const char* what);
  size_t Index(int64_t key_point) const;
  int64_t Row(int64_t row) const;
  void RememberState(int64_t gesture) { Remember(&Step::state, state_, gesture); }
  template <class Part>
  void Remember(std::optional<Part> Step::*part, const Part& now, int64_t gesture);
  void Retrace(std::vector<Step>* from, std::vector<Step>* to);
  void ChangeTrail(EditTrail changed, int64_t gesture);
  TrailFrame Present(double time) const { return {time, state_.key_points, orbit_.camera, state_.row}; }
  void PlaceAt(size_t key_point, double u, double v, double depth);
  double DefaultDepth(size_t key_point, double u, double v) const;

  std::shared_ptr<const EditableScene> scene_;
  EditState state_;
  OrbitCamera orbit_;
  int64_t capture_camera_ = 0;
  EditTrail trail_;
  std::vector<Step> undo_, redo_;
};

}  // namespace editnerf
