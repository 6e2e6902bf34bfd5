#include "libeditnerf/render/image_renderer.h"

#include <torch/torch.h>

#include <algorithm>
#include <vector>

#include "libeditnerf/base/error.h"
#include "libeditnerf/base/interrupt.h"
#include "libeditnerf/base/parallel.h"

namespace editnerf {
namespace {

// Unit directions [H * W, 3] through the pixel centres.
torch::Tensor PixelDirections(const Camera& camera) {
  auto directions = torch::empty({camera.height * camera.width, 3}, torch::kFloat64);
  double* const out = directions.data_ptr<double>();
  ParallelFor(camera.height, 16, [&](int64_t begin, int64_t end) {
    for (int64_t row = begin; row < end; ++row) {
      for (int64_t column = 0; column < camera.width; ++column) {
        const Vec3 d = camera.DirectionThrough(static_cast<double>(column) + 0.5, static_cast<double>(row) + 0.5);
        double* const pixel = out + 3 * (row * camera.width + column);
        pixel[0] = d.x;
        pixel[1] = d.y;
        pixel[2] = d.z;
      }
    }
  });
  return directions;
}

torch::Tensor Joined(const std::vector<RayResult>& parts, torch::Tensor RayResult::*member, const Camera& camera) {
  std::vector<torch::Tensor> tensors;
  for (const auto& part : parts) {
    if (!(part.*member).defined()) return {};
    tensors.push_back(part.*member);
  }
  const auto joined = torch::cat(tensors);
  return joined.dim() == 1 ? joined.view({camera.height, camera.width})
                           : joined.view({camera.height, camera.width, joined.size(1)});
}

}  // namespace

RenderedImage RenderImage(RadianceField& field, RayRenderer& renderer, const Camera& camera, const FrameStates& states,
                          const ImageOptions& options) {
  camera.Check("image camera");
  if (options.chunk < 1) Throw<ConfigError>("image chunk {}: expected at least one ray", options.chunk);
  torch::NoGradGuard no_grad;
  const auto& position = camera.position;
  const auto origin = torch::tensor({position.x, position.y, position.z}, torch::kFloat64).to(options.tensor);
  const auto directions = PixelDirections(camera).to(options.tensor);
  RayOptions ray_options;
  ray_options.background = options.background;
  ray_options.depth_only = options.depth_only;
  ray_options.march_steps = options.march_steps;

  const int64_t count = directions.size(0);
  std::vector<RayResult> parts(static_cast<size_t>((count + options.chunk - 1) / options.chunk));
  ParallelParts(static_cast<int64_t>(parts.size()), [&](int64_t index) {
    if (InterruptRequested()) Throw<Interrupted>("rendering stopped by request");
    const torch::NoGradGuard no_grad_here;  // each thread has its own
    const int64_t first = index * options.chunk;
    RayBatch rays;
    rays.direction = directions.narrow(0, first, std::min(options.chunk, count - first));
    rays.origin = origin.expand_as(rays.direction);
    rays.state = torch::zeros({rays.direction.size(0)}, directions.options().dtype(torch::kInt64));
    parts[static_cast<size_t>(index)] = renderer.Render(field, rays, states, ray_options);
  });
  RenderedImage image;
  for (const RayResult& part : parts) image.samples += part.samples;
  image.rgb = Joined(parts, &RayResult::rgb, camera);
  image.opacity = Joined(parts, &RayResult::opacity, camera);
  image.depth = Joined(parts, &RayResult::depth, camera);
  image.depth_valid = Joined(parts, &RayResult::depth_valid, camera);
  image.x_canonical = Joined(parts, &RayResult::x_canonical, camera);
  image.ambient = Joined(parts, &RayResult::ambient, camera);
  image.weights = Joined(parts, &RayResult::weights, camera);
  return image;
}

}  // namespace editnerf
