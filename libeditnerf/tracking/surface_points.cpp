#include "libeditnerf/base/error.h"
#include "libeditnerf/base/parallel.h"
#include "libeditnerf/base/shape.h"
#include "libeditnerf/tracking/pretrained_maps.h"

namespace editnerf {

void PretrainedMaps::Check(const Scene& scene) const {
  const auto frames = static_cast<int64_t>(scene.train.size());
  const auto check = [&](const torch::Tensor& map, const char* name, bool channels) {
    const bool fits = map.defined() && map.dim() == (channels ? 4 : 3) && map.size(0) == frames &&
                      map.size(1) == scene.height() && map.size(2) == scene.width();
    if (!fits) {
      Throw<DataError>(
          "{}: pretrained {} map: found {}, expected {} training frames of {} x {} pixels; pretrain at the image "
          "size that detection uses",
          scene.name, name, ShapeString(map), frames, scene.height(), scene.width());
    }
  };
  check(depth, "depth", false);
  check(ambient, "ambient", true);
  if (x_canonical.defined()) check(x_canonical, "canonical point", true);
}

torch::Tensor SurfacePoints(const Camera& camera, const torch::Tensor& depth) {
  CheckShape(depth, {camera.height, camera.width}, "depth map");
  const torch::Tensor distances = depth.to(torch::kFloat32).contiguous();
  torch::Tensor points = torch::empty({camera.height, camera.width, 3}, torch::kFloat32);
  const float* d = distances.data_ptr<float>();
  float* p = points.data_ptr<float>();
  ParallelFor(camera.height, 16, [&](int64_t begin, int64_t end) {
    for (int64_t row = begin; row < end; ++row) {
      for (int64_t column = 0; column < camera.width; ++column) {
        const int64_t index = row * camera.width + column;
        const Vec3 direction =
            camera.DirectionThrough(static_cast<double>(column) + 0.5, static_cast<double>(row) + 0.5);
        const Vec3 point = camera.position + direction * static_cast<double>(d[index]);
        p[3 * index] = static_cast<float>(point.x);
        p[3 * index + 1] = static_cast<float>(point.y);
        p[3 * index + 2] = static_cast<float>(point.z);
      }
    }
  });
  return points;
}

}  // namespace editnerf
