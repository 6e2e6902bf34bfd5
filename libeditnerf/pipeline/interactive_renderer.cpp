#include "libeditnerf/pipeline/interactive_renderer.h"

#include <torch/types.h>
#include <torch/utils.h>

#include <algorithm>
#include <utility>

#include "libeditnerf/base/error.h"
#include "libeditnerf/editing/key_point_tracks.h"
#include "libeditnerf/pipeline/render_plan.h"
#include "libeditnerf/pipeline/rendering.h"
#include "libeditnerf/render/image_renderer.h"

namespace editnerf {
namespace {

constexpr int64_t kMaxKeptBytes = 64 << 20;
constexpr int64_t kStripPixels = 16384;  // between two questions whether to stop: some hundredths of a second
constexpr int64_t kPreviewSteps = 2;     // of a picture's steps along rays, one in so many in a preview
constexpr int64_t kStripRows = 4;        // strips are whole multiples of the lattice of render/image_renderer.cpp

void Append(const void* data, size_t size, std::string* key) { key->append(static_cast<const char*>(data), size); }

// Everything that a picture depends on, but for the grids.
std::string KeyOf(const PictureRequest& request) {
  std::string key;
  for (const Vec3& k : request.key_points) {
    for (const double value : {k.x, k.y, k.z}) Append(&value, sizeof value, &key);
  }
  const Camera& c = request.camera;
  Append(c.orientation.m.data(), sizeof c.orientation.m, &key);
  for (const double value : {c.position.x, c.position.y, c.position.z, c.focal_length, c.principal_point[0],
                             c.principal_point[1], c.skew, c.pixel_aspect_ratio}) {
    Append(&value, sizeof value, &key);
  }
  Append(&request.weights, sizeof request.weights, &key);
  Append(c.radial_distortion.data(), sizeof c.radial_distortion, &key);
  Append(c.tangential_distortion.data(), sizeof c.tangential_distortion, &key);
  for (const int64_t value : {c.width, c.height, request.row, request.width}) {
    Append(&value, sizeof value, &key);
  }
  return key;
}

// Rows [first, first + count) of the camera's image.
Camera StripOf(const Camera& camera, int64_t first, int64_t count) {
  Camera strip = camera;
  strip.principal_point[1] -= static_cast<double>(first);
  strip.height = count;
  return strip;
}

// The picture, with colours of the weights over it where there is a surface.
torch::Tensor Blended(const RenderedImage& image, double share) {
  const auto over = WeightPicture(image.weights, image.rgb, image.depth_valid).to(torch::kFloat32) / 255;
  const auto blended = torch::lerp(image.rgb.to(torch::kCPU, torch::kFloat32).clamp(0, 1), over, share);
  return ToBytes(torch::where(image.depth_valid.to(torch::kCPU).unsqueeze(2), blended,
                              image.rgb.to(torch::kCPU, torch::kFloat32)));
}

}  // namespace

InteractiveRenderer::InteractiveRenderer(Run run) : run_(std::move(run)) {
  run_.field->eval();
  const int64_t count = run_.field->num_key_points();
  known_.resize(static_cast<size_t>(count));
  if (run_.renderer->occupancy() == nullptr || count == 0) return;
  cell_ = run_.field->options().box.LongestSide() / static_cast<double>(run_.config.render.occupancy_resolution);
  const torch::NoGradGuard no_grad;
  const auto num_frames = static_cast<int64_t>(run_.scene.train.size());
  const auto rows = torch::arange(num_frames, torch::TensorOptions(torch::kInt64).device(run_.device));
  const KeyPointTracks tracks(run_.field->States(rows).key_points);
  for (int64_t row = 0; row < num_frames; ++row) {
    for (size_t n = 0; n < known_.size(); ++n) known_[n].push_back(tracks.Row(row)[n]);
  }
}

FrameStates InteractiveRenderer::StatesOf(const PictureRequest& request) const {
  if (request.key_points.size() != known_.size()) {
    Throw<DataError>("picture: expected {} key points, found {}", known_.size(), request.key_points.size());
  }
  FrameStates states = run_.field->States(torch::tensor({request.row}, torch::kInt64).to(run_.device));
  if (request.key_points.empty()) return states;
  std::vector<double> values;
  for (const Vec3& k : request.key_points) values.insert(values.end(), {k.x, k.y, k.z});
  states.key_points = torch::tensor(values, torch::kFloat64)
                          .view({1, static_cast<int64_t>(request.key_points.size()), 3})
                          .to(states.key_points.options());
  return states;
}

void InteractiveRenderer::MakeRoom(const PictureRequest& request, const FrameStates& states) {
  if (!(cell_ > 0)) return;
  const double enough = request.preview || request.passing ? cell_ : 0.5 * cell_;
  const auto known = [&](size_t n) {
    return std::any_of(known_[n].begin(), known_[n].end(),
                       [&](const Vec3& place) { return Norm(place - request.key_points[n]) < enough; });
  };
  bool all_known = true;
  for (size_t n = 0; n < known_.size(); ++n) all_known = all_known && known(n);
  if (all_known) return;
  run_.renderer->CoverStates(*run_.field, states);
  for (size_t n = 0; n < known_.size(); ++n) {
    if (!known(n)) known_[n].push_back(request.key_points[n]);
  }
}

torch::Tensor InteractiveRenderer::RenderStrips(const PictureRequest& request, const FrameStates& states,
                                                const std::function<bool()>& stop) const {
  const Camera camera = WithSize(request.camera, request.width, 0);
  ImageOptions options;
  options.tensor = torch::TensorOptions(torch::kFloat32).device(run_.device);
  if (request.preview) options.march_steps = std::max<int64_t>(run_.config.render.march_steps / kPreviewSteps, 1);
  int64_t rows = camera.height;
  if (stop) rows = std::max<int64_t>(kStripPixels / camera.width / kStripRows, 1) * kStripRows;
  std::vector<torch::Tensor> strips;
  for (int64_t first = 0; first < camera.height; first += rows) {
    if (stop && stop()) return {};
    const Camera strip = StripOf(camera, first, std::min(rows, camera.height - first));
    const RenderedImage image = RenderImage(*run_.field, *run_.renderer, strip, states, options);
    strips.push_back(request.weights > 0 ? Blended(image, request.weights) : ToBytes(image.rgb));
  }
  return torch::cat(strips);
}

torch::Tensor InteractiveRenderer::Render(const PictureRequest& request, const std::function<bool()>& stop) {
  if (!(request.weights >= 0 && request.weights <= 1)) {
    Throw<DataError>("weights: expected a share from 0 to 1, found {}", request.weights);
  }
  if (request.weights > 0 && known_.empty()) {
    Throw<DataError>("weights: this run has no key points; it was trained as a static scene");
  }
  const std::string key = KeyOf(request);
  const auto found = std::find_if(kept_.begin(), kept_.end(), [&](const Kept& kept) { return kept.key == key; });
  if (found != kept_.end()) {
    kept_.splice(kept_.begin(), kept_, found);
    return found->picture;
  }
  const torch::NoGradGuard no_grad;
  const FrameStates states = StatesOf(request);
  MakeRoom(request, states);
  const torch::Tensor picture = RenderStrips(request, states, stop);
  if (!picture.defined() || request.preview || request.passing) return picture;
  kept_.push_front({key, picture});
  kept_bytes_ += picture.numel();
  while (kept_bytes_ > kMaxKeptBytes && kept_.size() > 1) {
    kept_bytes_ -= kept_.back().picture.numel();
    kept_.pop_back();
  }
  return picture;
}

}  // namespace editnerf
