#include "libeditnerf/pipeline/rendering.h"

#include <torch/types.h>
#include <torch/utils.h>

#include <algorithm>
#include <memory>
#include <optional>

#include "libeditnerf/base/error.h"
#include "libeditnerf/base/file.h"
#include "libeditnerf/base/interrupt.h"
#include "libeditnerf/base/logging.h"
#include "libeditnerf/base/progress.h"
#include "libeditnerf/base/shape.h"
#include "libeditnerf/imaging/image_file.h"
#include "libeditnerf/imaging/palette.h"
#include "libeditnerf/imaging/video_file.h"
#include "libeditnerf/render/image_renderer.h"

namespace editnerf {
namespace {

namespace fs = std::filesystem;

constexpr double kDarkest = 0.25;  // of a weight picture: a black part's key point can still be told

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
  std::vector<float> values;
  for (int64_t n = 0; n < count; ++n) {
    for (const uint8_t value : KeyPointColor(n)) values.push_back(static_cast<float>(value) / 255);
  }
  return torch::tensor(values).view({count, 3});
}

}  // namespace

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
  return ScalarPicture((far - known) / (far - near)) * known.isfinite().to(torch::kUInt8).unsqueeze(2);
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
