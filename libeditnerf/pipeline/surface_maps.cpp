#include "libeditnerf/pipeline/surface_maps.h"

#include <algorithm>
#include <cmath>

#include "libeditnerf/base/progress.h"
#include "libeditnerf/render/image_renderer.h"

namespace editnerf {
namespace {

// Surface maps are marched in finer steps than pictures: the median depth is known to half a step only, and near the
// camera a step of training is some percent of the depth.
constexpr int64_t kFinerSurfaces = 3;
constexpr int64_t kMeasuredSurfaces = 16;  // frames whose depth is compared with the truth
constexpr int64_t kMeasuredEvery = 3;      // pixels of theirs along each side, odd: so many rays say the same

torch::Tensor Enlarge(const torch::Tensor& map, int64_t height, int64_t width) {
  const auto index = [](int64_t from, int64_t to) {
    return ((torch::arange(to, torch::kFloat64) + 0.5) * static_cast<double>(from) / static_cast<double>(to))
        .floor()
        .to(torch::kInt64)
        .clamp_max(from - 1);
  };
  return map.index_select(0, index(map.size(0), height)).index_select(1, index(map.size(1), width));
}

const Camera& CameraOf(const Scene& scene, int64_t row) {
  return scene.frames[static_cast<size_t>(scene.train[static_cast<size_t>(row)])].camera;
}

// At a share `factor` of its size.
Camera Reduced(const Camera& camera, double factor) {
  const auto reduced = [&](int64_t side) {
    return std::max<int64_t>(1, std::llround(static_cast<double>(side) * factor));
  };
  return factor < 1 ? camera.Resized(reduced(camera.width), reduced(camera.height)) : camera;
}

// With the rays through the middle pixel of each whole square of `every` pixels alone.
Camera Thinned(Camera camera, int64_t every) {
  camera.width -= camera.width % every;
  camera.height -= camera.height % every;
  return camera.Resized(camera.width / every, camera.height / every);
}

// The surface that `camera` sees in the state of training frame number `row`.
RenderedImage RenderSurface(const Run& run, const Camera& camera, int64_t row) {
  ImageOptions options;
  options.tensor = torch::TensorOptions(torch::kFloat32).device(run.device);
  options.exact = true;  // detection stands on it
  options.depth_only = run.config.render.sampler == "occupancy";
  options.march_steps = kFinerSurfaces * run.config.render.march_steps;
  return RenderImage(*run.field, *run.renderer, camera,
                     run.field->States(torch::tensor({row}, torch::kInt64).to(run.device)), options);
}

}  // namespace

std::vector<DepthError> MeasureDepth(const Run& run, const Scene& scene) {
  const torch::NoGradGuard no_grad;
  run.field->eval();
  const auto frames = static_cast<int64_t>(scene.train.size()), count = std::min(frames, kMeasuredSurfaces);
  const int64_t every = std::min(scene.width(), scene.height()) < kMeasuredEvery ? 1 : kMeasuredEvery;
  std::vector<torch::Tensor> depth;
  std::vector<int64_t> rows;
  for (int64_t i = 0; i < count; ++i) {
    rows.push_back((2 * i + 1) * frames / (2 * count));
    depth.push_back(
        RenderSurface(run, Thinned(CameraOf(scene, rows.back()), every), rows.back()).depth.to(torch::kCPU));
  }
  return MeasureDepthErrors(torch::stack(depth), scene, rows, every);
}

PretrainedMaps RenderSurfaceMaps(Run& run, const Scene& scene, int64_t max_pixels) {
  const torch::NoGradGuard no_grad;
  const int64_t height = scene.height(), width = scene.width(), count = static_cast<int64_t>(scene.train.size());
  const double pixels = static_cast<double>(height * width * count);
  const double factor = std::min(1.0, std::sqrt(static_cast<double>(max_pixels) / pixels));
  run.field->eval();
  PretrainedMaps maps;
  // Written in place: a list of all maps and their stack would take twice the memory, which long sequences do not have.
  const auto store = [&](const torch::Tensor& map, int64_t t, torch::Tensor* all) {
    const torch::Tensor enlarged = Enlarge(map.to(torch::kCPU), height, width);
    if (!all->defined()) {
      std::vector<int64_t> shape = enlarged.sizes().vec();
      shape.insert(shape.begin(), count);
      *all = torch::empty(shape, enlarged.options());
    }
    all->select(0, t).copy_(enlarged);
  };
  Progress bar("surfaces", static_cast<double>(count));
  for (int64_t t = 0; t < count; ++t) {
    const RenderedImage image = RenderSurface(run, Reduced(CameraOf(scene, t), factor), t);
    store(image.depth, t, &maps.depth);
    store(image.ambient, t, &maps.ambient);
    if (run.config.field.HasWarp()) store(image.x_canonical, t, &maps.x_canonical);
    bar.Update(static_cast<double>(t + 1));
  }
  bar.Finish();
  return maps;
}

}  // namespace editnerf
