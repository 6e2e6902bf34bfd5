#include "libeditnerf/server/session_json.h"

#include <algorithm>
#include <functional>
#include <map>
#include <vector>

#include "libeditnerf/base/error.h"
#include "libeditnerf/field/key_points.h"
#include "libeditnerf/imaging/palette.h"
#include "libeditnerf/scene/scene_json.h"

namespace editnerf {
namespace {

Json ToJson(const Vec3& v) { return {v.x, v.y, v.z}; }

Json ToJson(const Camera& camera) {
  return {{"orientation", camera.orientation.m},
          {"position", ToJson(camera.position)},
          {"focal_length", camera.focal_length},
          {"aspect", camera.pixel_aspect_ratio},
          {"skew", camera.skew},
          {"principal_point", camera.principal_point},
          {"radial", camera.radial_distortion},
          {"tangential", camera.tangential_distortion},
          {"width", camera.width},
          {"height", camera.height}};
}

const char* LevelName(ReachLevel level) {
  switch (level) {
    case ReachLevel::kNear:
      return "near";
    case ReachLevel::kFar:
      return "far";
    case ReachLevel::kBeyond:
      break;
  }
  return "beyond";
}

// The arguments of an operation.
class Arguments {
 public:
  Arguments(const Json& json, const std::string& where) : json_(json), where_(where) {}

  double Number(const char* key) const { return JsonNumber(json_, key, where_); }
  int64_t Integer(const char* key) const { return JsonInteger(json_, key, where_); }
  int64_t KeyPoint() const { return Integer("key_point"); }
  int64_t Gesture() const { return json_.contains("gesture") ? Integer("gesture") : 0; }
  Vec3 Position() const {
    const auto p = JsonNumbers(json_, "position", 3, where_);
    return {p[0], p[1], p[2]};
  }

 private:
  const Json& json_;
  const std::string& where_;
};

using Operation = std::function<void(const Arguments&, EditSession&)>;

const std::map<std::string, Operation>& Operations() {
  using A = const Arguments&;
  using S = EditSession&;
  static const std::map<std::string, Operation> operations = {
      {"move", [](A a, S s) { s.MoveToPixel(a.KeyPoint(), a.Number("u"), a.Number("v"), a.Gesture()); }},
      {"nudge", [](A a, S s) { s.Nudge(a.KeyPoint(), a.Number("u"), a.Number("v"), a.Gesture()); }},
      {"depth", [](A a, S s) { s.ScaleDepth(a.KeyPoint(), a.Number("factor"), a.Gesture()); }},
      {"place", [](A a, S s) { s.SetPosition(a.KeyPoint(), a.Position(), a.Gesture()); }},
      {"reset", [](A a, S s) { s.Reset(a.KeyPoint(), a.Gesture()); }},
      {"reset_all", [](A, S s) { s.ResetAll(); }},
      {"snap", [](A a, S s) { s.SnapTo(a.Integer("row"), a.Gesture()); }},
      {"undo", [](A, S s) { s.Undo(); }},
      {"redo", [](A, S s) { s.Redo(); }},
      {"camera", [](A a, S s) { s.UseCaptureCamera(a.Integer("frame")); }},
      {"reset_camera", [](A, S s) { s.ResetCamera(); }},
      {"orbit", [](A a, S s) { s.Orbit(a.Number("right"), a.Number("over")); }},
      {"pan", [](A a, S s) { s.Pan(a.Number("u"), a.Number("v")); }},
      {"zoom", [](A a, S s) { s.Zoom(a.Number("factor")); }},
      {"key_frame", [](A a, S s) { s.AddKeyFrame(a.Number("time"), a.Gesture()); }},
      {"show_trail", [](A a, S s) { s.ShowTrail(a.Number("time"), a.Gesture()); }},
      {"replace_key_frame", [](A a, S s) { s.ReplaceKeyFrame(a.Integer("index"), a.Gesture()); }},
      {"move_key_frame", [](A a, S s) { s.MoveKeyFrame(a.Integer("index"), a.Number("time"), a.Gesture()); }},
      {"remove_key_frame", [](A a, S s) { s.RemoveKeyFrame(a.Integer("index"), a.Gesture()); }},
      {"clear_trail", [](A a, S s) { s.ClearTrail(a.Gesture()); }},
  };
  return operations;
}

}  // namespace

Json SceneToPageJson(const EditableScene& scene, const std::string& title) {
  Json frames = Json::array(), tracks = Json::array(), colors = Json::array(), reach = Json::array(),
       rows = Json::array();
  for (const SceneFrame& frame : scene.scene.frames) {
    frames.push_back({{"id", frame.id}, {"camera", ToJson(frame.camera)}});
  }
  for (const int64_t frame : scene.scene.train) rows.push_back(frame);
  for (int64_t n = 0; n < scene.tracks.num_key_points(); ++n) {
    Json track = Json::array();
    for (int64_t row = 0; row < scene.tracks.num_frames(); ++row) {
      track.push_back(ToJson(scene.tracks.Row(row)[static_cast<size_t>(n)]));
    }
    tracks.push_back(std::move(track));
    colors.push_back(KeyPointColor(n));
    reach.push_back(kFarReach * std::max(scene.tracks.Extent(n), kSmallestTrackRange));
  }
  return {{"title", title},
          {"frames", frames},
          {"training_frames", rows},
          {"points", PointsToJson(scene.scene.points)},
          {"tracks", tracks},
          {"colors", colors},
          {"reach", reach},
          {"box", {ToJson(scene.box.low), ToJson(scene.box.high)}},
          {"near", scene.scene.transform.near},
          {"far", scene.scene.transform.far}};
}

Json SessionToPageJson(const EditSession& session) {
  Json key_points = Json::array(), times = Json::array();
  const auto& positions = session.state().key_points;
  for (size_t n = 0; n < positions.size(); ++n) {
    const Handle handle = session.HandleOf(static_cast<int64_t>(n));
    key_points.push_back({{"position", ToJson(positions[n])},
                          {"u", handle.u},
                          {"v", handle.v},
                          {"depth", handle.depth},
                          {"in_front", handle.in_front},
                          {"in_image", handle.in_image},
                          {"distance", handle.reach.distance},
                          {"share", handle.reach.share},
                          {"level", LevelName(handle.reach.level)}});
  }
  const auto& trail = session.trail().frames();
  for (const TrailFrame& frame : trail) times.push_back(frame.time - trail.front().time);
  return {{"key_points", key_points},
          {"camera", ToJson(session.camera())},
          {"capture_camera", session.capture_camera()},
          {"row", session.state().row},
          {"can_undo", session.can_undo()},
          {"can_redo", session.can_redo()},
          {"trail", {{"times", times}, {"duration", session.trail().Duration()}}}};
}

Json MotionToPageJson(const MotionStatus& status) {
  static constexpr const char* kNames[] = {"none", "running", "done", "failed"};
  Json track = Json::array(), path = Json::array();
  for (const Pixel& p : status.track) track.push_back({p.u, p.v});
  for (const Vec3& p : status.path) path.push_back({p.x, p.y, p.z});
  return {{"state", kNames[static_cast<int>(status.state)]},
          {"done", status.done},
          {"total", status.total},
          {"message", status.message},
          {"track", track},
          {"path", path},
          {"fps", status.fps},
          {"farthest", status.farthest}};
}

void ApplyOperation(const Json& operation, const std::string& where, EditSession* session) {
  const Json& name = JsonField(operation, "do", where);
  const auto found = name.is_string() ? Operations().find(name.get<std::string>()) : Operations().end();
  if (found == Operations().end()) {
    std::vector<std::string> names;
    for (const auto& item : Operations()) names.push_back(item.first);
    Throw<DataError>("{}: do: expected one of {}, found {}", where, fmt::join(names, ", "),
                     name.dump(-1, ' ', false, Json::error_handler_t::replace).substr(0, 40));
  }
  found->second(Arguments(operation, where), *session);
}

}  // namespace editnerf
