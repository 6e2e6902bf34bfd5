// enf-transfer RUN --video V --point x,y --key-point I --out EDIT.json: one video's motion drives a key point of a run.
#include <algorithm>
#include <cstdio>
#include <filesystem>
#include <string>
#include <vector>

#include "libeditnerf/base/error.h"
#include "libeditnerf/base/file.h"
#include "libeditnerf/base/interrupt.h"
#include "libeditnerf/base/logging.h"
#include "libeditnerf/base/progress.h"
#include "libeditnerf/editing/edit_session.h"
#include "libeditnerf/editing/motion_transfer.h"
#include "libeditnerf/pipeline/rendering.h"
#include "libeditnerf/tracking/flow_choice.h"
#include "support/run.h"

namespace {

struct Request {
  std::filesystem::path run, video, out, preview;
  std::string point, camera, code_frame;
  std::vector<std::string> pairs;
  int64_t key_point = 0;
  int64_t axes = 2;
  bool reversed = false;
  editnerf::PointTrackOptions track;
};

void Define(CLI::App& app, Request& request) {
  app.add_option("RUN", request.run, "run folder of enf-train")->required();
  app.add_option("--video", request.video, "what drives: a video, a folder of images, or a scene folder")->required();
  app.add_option("--point", request.point, "X,Y: what to follow, in pixels of the first frame")
      ->type_name("X,Y")
      ->required();
  app.add_option("--key-point", request.key_point, "which one is driven, numbered from 0")->required();
  app.add_option("--out", request.out, "where to write the edit file (docs/edit-files.md)")->required();
  app.add_option("--preview", request.preview, "an .mp4 file: renders the edit as well");
  CLI::Option* const pair =
      app.add_option("--pair", request.pairs,
                     "VIDEO_FRAME:CAPTURE_FRAME: in these frames the two are in the same state; repeatable, at least "
                     "twice; without it the range of the one motion is laid onto the range of the other")
          ->type_name("N:ID")
          ->allow_extra_args(false);
  app.add_flag("--reverse", request.reversed, "the other way round along the range")->excludes(pair);
  app.add_option("--axes", request.axes,
                 "1: along the longest axes of both motions alone; 2: across them as well, where both have a width")
      ->check(CLI::Range(1, 2).description(""))
      ->capture_default_str()
      ->excludes(pair);
  app.add_option("--first-frame", request.track.first_frame, "of the video, in which the point is")
      ->check(CLI::NonNegativeNumber);
  app.add_option("--last-frame", request.track.last_frame, "of the video; the last one by default")
      ->check(CLI::NonNegativeNumber)
      ->default_str("");
  app.add_option("--camera", request.camera, "frame from where it is seen; the middle training frame by default");
  app.add_option("--code-frame", request.code_frame,
                 "training frame that the other key points are taken from; the middle one by default");
}

editnerf::Pixel ParsePoint(const std::string& text) {
  editnerf::Pixel point;
  int used = 0;
  if (std::sscanf(text.c_str(), "%lf,%lf%n", &point.u, &point.v, &used) != 2 ||
      text.size() != static_cast<size_t>(used)) {
    editnerf::Throw<editnerf::ConfigError>("--point: expected X,Y in pixels such as 160,90, found '{}'", text);
  }
  return point;
}

// The row of the training frames with this id.
int64_t RowOf(const editnerf::Scene& scene, const std::string& id, const std::string& what) {
  for (size_t row = 0; row < scene.train.size(); ++row) {
    if (scene.frames[static_cast<size_t>(scene.train[row])].id == id) return static_cast<int64_t>(row);
  }
  editnerf::Throw<editnerf::DataError>("{}: the run has no training frame '{}'", what, id);
}

editnerf::FramePair ParsePair(const std::string& text, const editnerf::Scene& scene) {
  long long frame = 0;
  int used = 0;
  if (std::sscanf(text.c_str(), "%lld:%n", &frame, &used) != 1 || used == 0 ||
      text.size() == static_cast<size_t>(used)) {
    editnerf::Throw<editnerf::ConfigError>("--pair: expected VIDEO_FRAME:CAPTURE_FRAME such as 40:000012, found '{}'",
                                           text);
  }
  return {frame, RowOf(scene, text.substr(static_cast<size_t>(used)), "--pair " + text)};
}

editnerf::PointTrack Follow(const Request& request, const editnerf::FlowConfig& config) {
  editnerf::FrameReader frames(request.video);
  editnerf::Progress bar("following the point", static_cast<double>(std::max<int64_t>(frames.frame_count(), 1)));
  auto track = editnerf::TrackPoint(frames, *editnerf::MakeOpticalFlow(config), request.track, request.video.string(),
                                    [&](int64_t done, int64_t) {
                                      if (editnerf::InterruptRequested()) {
                                        editnerf::Throw<editnerf::Interrupted>("interrupted while following the point");
                                      }
                                      bar.Update(static_cast<double>(done));
                                    });
  bar.Finish();
  return track;
}

void Report(const std::vector<editnerf::Vec3>& path, int64_t key_point, const editnerf::KeyPointTracks& tracks) {
  double farthest = 0;
  size_t at = 0;
  for (size_t i = 0; i < path.size(); ++i) {
    const double share = tracks.ReachOf(key_point, path[i]).share;
    if (share > farthest) farthest = share, at = i;
  }
  editnerf::LogInfo("{} frames; at most {:.0f}% of its range from where training saw key point {}", path.size(),
                    100 * farthest, key_point);
  if (farthest >= editnerf::kFarReach) {
    editnerf::LogWarning(
        "in frame {} of the edit key point {} is {:.0f}% of its range from where training saw it: the "
        "picture may {} there",
        at, key_point, 100 * farthest, farthest >= editnerf::kBeyondReach ? "come apart" : "lose detail");
  }
}

void Transfer(Request& request, const editnerf::CommonOptions& common) {
  request.track.start = ParsePoint(request.point);
  const editnerf::Run run = editnerf::LoadRun(request.run, common.device);
  const editnerf::EditableScene scene = editnerf::MakeEditableScene(run);
  const auto& frames = run.scene.frames;
  const std::string middle = frames[static_cast<size_t>(run.scene.train[run.scene.train.size() / 2])].id;
  if (request.camera.empty()) request.camera = middle;
  if (request.code_frame.empty()) request.code_frame = middle;
  RowOf(run.scene, request.code_frame, "--code-frame");
  editnerf::TransferOptions options;
  options.key_point = request.key_point;
  options.reversed = request.reversed;
  options.axes = request.axes;
  for (const std::string& pair : request.pairs) options.pairs.push_back(ParsePair(pair, run.scene));
  const auto seen_from =
      std::find_if(frames.begin(), frames.end(), [&](const auto& frame) { return frame.id == request.camera; });
  if (seen_from == frames.end()) {
    editnerf::Throw<editnerf::DataError>("--camera: the run has no frame '{}'", request.camera);
  }
  options.view = seen_from->camera;
  editnerf::CheckKeyPoint(scene.tracks, options.key_point);  // before minutes of optical flow
  const editnerf::PointTrack track = Follow(request, common.config.flow);
  const auto path = editnerf::TransferMotion(track, scene.tracks, options);
  Report(path, options.key_point, scene.tracks);
  const editnerf::EditFile edit =
      editnerf::DrivenEdit(path, options.key_point, track.fps, request.code_frame, request.camera);
  editnerf::WriteFileAtomically(request.out, editnerf::WriteEditFile(edit));
  editnerf::LogInfo("wrote {}", request.out.string());
  if (request.preview.empty()) return;
  editnerf::RenderOutput output;
  output.path = request.preview;
  editnerf::RenderFrames(run, editnerf::PlanEdit(run, edit), output);
}

}  // namespace

int main(int argc, char** argv) {
  Request request;
  return editnerf::RunProgram(
      "enf-transfer", "Drives a key point of a run by what moves in a video.", argc, argv,
      [&](CLI::App& app) { Define(app, request); },
      [&](const editnerf::CommonOptions& common) { Transfer(request, common); });
}
