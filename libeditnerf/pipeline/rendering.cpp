#include "libeditnerf/pipeline/rendering.h"

#include <torch/torch.h>

#include <algorithm>
#include <cmath>
#include <memory>
#include <opencv2/imgproc.hpp>
#include <optional>
#include <sstream>

#include "libeditnerf/base/error.h"
#include "libeditnerf/base/file.h"
#include "libeditnerf/base/interrupt.h"
#include "libeditnerf/base/logging.h"
#include "libeditnerf/base/progress.h"
#include "libeditnerf/base/shape.h"
#include "libeditnerf/editing/edited_key_points.h"
#include "libeditnerf/imaging/camera_file.h"
#include "libeditnerf/imaging/image_file.h"
#include "libeditnerf/imaging/video_file.h"
#include "libeditnerf/render/image_renderer.h"
#include "libeditnerf/training/held_out.h"

namespace editnerf {
namespace {

namespace fs = std::filesystem;

constexpr double kDarkest = 0.25;  // of a weight picture: a black part's key point can still be told

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

Camera WithSize(const Camera& camera, int64_t width, int64_t height) {
  if (width <= 0 && height <= 0) return camera;
  const double aspect = static_cast<double>(camera.width) / static_cast<double>(camera.height);
  const auto side = [](double pixels) { return std::max<int64_t>(1, std::llround(pixels)); };
  if (width <= 0) width = side(static_cast<double>(height) * aspect);
  if (height <= 0) height = side(static_cast<double>(width) / aspect);
  return camera.Resized(width, height);
}

// Widens the occupancy grids. States nearer than half a cell to one already covered are covered by the grids' dilation.
void Cover(const Run& run, const RenderJob& job) {
  if (run.renderer->occupancy() == nullptr || run.field->num_key_points() == 0) return;
  const double cell =
      run.field->options().box.LongestSide() / static_cast<double>(run.config.render.occupancy_resolution);
  const auto alike = [&](const FrameStates& a, const FrameStates& b) {
    if (a.warp_code.defined() && !torch::equal(a.warp_code, b.warp_code)) return false;
    return (a.key_points - b.key_points).norm(2, -1).max().item<double>() < 0.5 * cell;
  };
  std::vector<const FrameStates*> covered;
  Progress bar("making room for the edit", static_cast<double>(job.frames.size()));
  for (size_t i = 0; i < job.frames.size(); ++i) {
    if (InterruptRequested()) Throw<Interrupted>("rendering stopped by request");
    const FrameStates& states = job.frames[i].states;
    if (std::none_of(covered.begin(), covered.end(), [&](const FrameStates* other) { return alike(states, *other); })) {
      run.renderer->CoverStates(*run.field, states);
      covered.push_back(&states);
    }
    bar.Update(static_cast<double>(i + 1));
  }
  bar.Finish();
}

// Where one kind of picture goes: PATH/NAME<suffix>.png, or PATH<suffix>.mp4.
class PictureSink {
 public:
  PictureSink(const RenderOutput& output, std::string suffix, double fps)
      : path_(output.path), suffix_(std::move(suffix)), fps_(fps) {}

  void Write(const std::string& name, const torch::Tensor& picture) {
    if (path_.extension() != ".mp4") return WritePng(path_ / (name + suffix_ + ".png"), picture);
    if (!video_) {
      video_ = std::make_unique<VideoWriter>(BesideVideo(path_, suffix_), picture.size(1), picture.size(0), fps_);
    }
    video_->Write(picture);
  }
  void Finish() {
    if (video_) video_->Finish();
  }

 private:
  fs::path path_;
  std::string suffix_;
  double fps_;
  std::unique_ptr<VideoWriter> video_;
};

struct DepthRange {
  double near, far;
};

// Of the first picture, with some room: one scale for all, or a video would flicker.
DepthRange RangeOf(const torch::Tensor& depth, const RayRenderer& renderer) {
  const auto finite = std::get<0>(depth.masked_select(depth.isfinite()).sort());
  const int64_t count = finite.size(0);
  if (count == 0) return {renderer.near(), renderer.far()};
  const double low = finite[count / 100].item<double>(), high = finite[count - 1 - count / 100].item<double>();
  const double room = 0.1 * std::max(high - low, 1e-3 * high);
  return {low - room, high + room};
}

void CheckJob(const Run& run, const RenderJob& job, const RenderOutput& output) {
  if (job.frames.empty()) Throw<DataError>("{}: no frames to render", output.path.string());
  if (output.weights && run.field->num_key_points() == 0) {
    Throw<DataError>("weights: this run has no key points; give the run of enf-train, of a scene with key points");
  }
  if (output.path.extension() != ".mp4") return;
  const Camera first = WithSize(job.frames.front().camera, output.width, output.height);
  for (const PlannedFrame& frame : job.frames) {
    const Camera camera = WithSize(frame.camera, output.width, output.height);
    if (camera.width == first.width && camera.height == first.height) continue;
    Throw<DataError>("{}: frame {} has {} x {} pixels and the first one {} x {}; give one size for the video",
                     output.path.string(), frame.name, camera.width, camera.height, first.width, first.height);
  }
}

torch::Tensor ColorsOfKeyPoints(int64_t count) {
  const auto colors = torch::tensor({255, 70,  60,  70,  200, 255, 255, 210, 50,  90,  255, 110,  //
                                     255, 110, 240, 255, 150, 50,  140, 130, 255, 255, 255, 255},
                                    torch::kFloat32)
                          .view({8, 3}) /
                      255;
  return colors.index_select(0, torch::arange(count, torch::kInt64).remainder(8));
}

}  // namespace

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

fs::path BesideVideo(const fs::path& video, const std::string& suffix) {
  return video.parent_path() / (video.stem().string() + suffix + video.extension().string());
}

void RenderFrames(const Run& run, const RenderJob& job, const RenderOutput& output) {
  const torch::NoGradGuard no_grad;
  CheckJob(run, job, output);
  MakeFolder(output.path.extension() == ".mp4" ? fs::absolute(output.path).parent_path() : output.path);
  run.field->eval();
  if (job.unseen_states) Cover(run, job);

  const double fps = output.fps > 0 ? output.fps : job.fps;
  PictureSink color(output, "", fps), depth(output, "_depth", fps), weights(output, "_weights", fps);
  std::optional<DepthRange> range;
  ImageOptions options;
  options.tensor = torch::TensorOptions(torch::kFloat32).device(run.device);
  Progress bar("rendering", static_cast<double>(job.frames.size()));
  for (size_t i = 0; i < job.frames.size(); ++i) {
    const PlannedFrame& frame = job.frames[i];
    const Camera camera = WithSize(frame.camera, output.width, output.height);
    const RenderedImage image = RenderImage(*run.field, *run.renderer, camera, frame.states, options);
    color.Write(frame.name, ToBytes(image.rgb));
    if (output.depth) {
      if (!range) range = RangeOf(image.depth, *run.renderer);
      depth.Write(frame.name, DepthPicture(image.depth, range->near, range->far));
    }
    if (output.weights) weights.Write(frame.name, WeightPicture(image.weights, image.rgb, image.depth_valid));
    bar.Update(static_cast<double>(i + 1), frame.name);
  }
  bar.Finish();
  for (PictureSink* sink : {&color, &depth, &weights}) sink->Finish();
  if (range) LogInfo("depth pictures: bright {:.3f}, dark {:.3f} scene units", range->near, range->far);
}

torch::Tensor ToBytes(const torch::Tensor& rgb) {
  CheckShape(rgb, {kAny, kAny, 3}, "picture");
  const auto bytes = (rgb.detach().clamp(0, 1) * 255).round().nan_to_num(0);
  return bytes.to(torch::kCPU, torch::kUInt8).contiguous();
}

torch::Tensor DepthPicture(const torch::Tensor& depth, double near, double far) {
  CheckShape(depth, {kAny, kAny}, "depth");
  const auto known = depth.detach().to(torch::kCPU, torch::kFloat64);
  auto brightness = ((far - known) / (far - near) * 255).clamp(0, 255).nan_to_num(0);
  brightness = brightness.round().to(torch::kUInt8).contiguous();
  const cv::Mat gray(static_cast<int>(depth.size(0)), static_cast<int>(depth.size(1)), CV_8UC1,
                     brightness.data_ptr<uint8_t>());
  cv::Mat picture;
  cv::applyColorMap(gray, picture, cv::COLORMAP_INFERNO);
  cv::cvtColor(picture, picture, cv::COLOR_BGR2RGB);
  const auto colors = torch::from_blob(picture.data, {depth.size(0), depth.size(1), 3}, torch::kUInt8);
  return colors * known.isfinite().to(torch::kUInt8).unsqueeze(2);
}

torch::Tensor WeightPicture(const torch::Tensor& weights, const torch::Tensor& rgb, const torch::Tensor& surface) {
  CheckShape(rgb, {kAny, kAny, 3}, "picture");
  CheckShape(surface, {rgb.size(0), rgb.size(1)}, "surface");
  const auto known = rgb.detach().to(torch::kCPU, torch::kFloat32).clamp(0, 1);
  const auto luminance = known.matmul(torch::tensor({0.2126f, 0.7152f, 0.0722f})).unsqueeze(2);
  torch::Tensor colors = ColorsOfKeyPoints(1).view({1, 1, 3});
  if (weights.defined()) {
    CheckShape(weights, {rgb.size(0), rgb.size(1), kAny}, "weights");
    colors = weights.detach().to(torch::kCPU, torch::kFloat32).matmul(ColorsOfKeyPoints(weights.size(2)));
  }
  const auto shaded = colors * (kDarkest + (1 - kDarkest) * luminance);
  return ToBytes(torch::where(surface.to(torch::kCPU).unsqueeze(2), shaded, luminance.expand_as(known)));
}

}  // namespace editnerf
