// Pictures that evaluate less (RenderImage without `exact`) against those that evaluate everything.
#include <torch/types.h>
#include <torch/utils.h>

#include <limits>

#include "libeditnerf/field/hyperspace_field.h"
#include "libeditnerf/render/image_renderer.h"
#include "libeditnerf/render/ray_renderer.h"
#include "tests/catch.h"

using namespace editnerf;

namespace {

const Box kBox{{-1, -1, -1}, {1, 1, 1}};
constexpr double kNear = 0.3, kFar = 3.0;
constexpr int64_t kFrames = 3;

// Random, but smooth at the scale of a pixel: nothing is finer than a sixth of the box.
std::shared_ptr<HyperspaceField> SmoothField(int64_t key_points, double bias, double contrast,
                                             const std::string& kernel = "auto") {
  HyperspaceFieldOptions options;
  FieldConfig& config = options.config;
  config.kind = "fast";
  config.fast.kernel = kernel;
  config.warp.enabled = Choice::kOff;
  config.use_appearance = Choice::kOff;
  HashEncodingConfig& hash = config.fast.canonical_hash;
  hash.num_levels = 3, hash.log2_table_size = 10, hash.base_resolution = 2, hash.finest_resolution = 6;
  config.fast.local_hash = hash;
  config.fast.density_bias = bias;
  options.num_frames = kFrames;
  options.box = kBox;
  options.num_key_points = key_points;
  options.initial_tracks = torch::rand({kFrames, key_points, 3}) - 0.5;
  auto field = std::make_shared<HyperspaceField>(options);
  const torch::NoGradGuard no_grad;
  for (const auto& item : field->named_parameters()) {
    if (item.key().find("_table") != std::string::npos) item.value().uniform_(-4, 4);
    if (item.key().find("density_network.output.weight") != std::string::npos)
      item.value().mul_(contrast);  // solid and empty
  }
  field->SetStep(1'000'000);
  return field;
}

RayRenderer MakeRenderer(int64_t key_points) {
  RenderConfig config;
  config.sampler = "occupancy";
  config.march_steps = 160;
  config.occupancy_resolution = 8;
  config.early_stop = 1e-3;
  std::optional<Box> local;
  if (key_points == 1) local = Box{{-2, -2, -2}, {2, 2, 2}};
  return {config, kNear, kFar, kBox, local};
}

Camera MakeCamera() {
  Camera camera;
  camera.position = {0, 0, -2};
  camera.width = 96;
  camera.height = 61;
  camera.focal_length = 120;
  camera.principal_point = {48, 30.5};
  return camera;
}

RayBatch RaysOf(int64_t count) {
  RayBatch rays;
  rays.origin = torch::tensor({0.0F, 0.0F, -2.0F}).expand({count, 3});
  const auto toward = torch::rand({count, 3}) - torch::tensor({0.5F, 0.5F, -1.5F});
  rays.direction = toward / toward.norm(2, 1, true);
  rays.state = torch::randint(kFrames, {count}, torch::kInt64);
  return rays;
}

FrameStates AllStates(HyperspaceField& field) { return field.States(torch::arange(kFrames, torch::kInt64)); }

double Largest(const torch::Tensor& difference) { return difference.abs().max().item<double>(); }

}  // namespace

TEST_CASE("a picture that starts rays from their neighbours shows the same to a few 8-bit levels, with fewer samples") {
  const torch::NoGradGuard no_grad;
  constexpr double kLevel = 1.0 / 255;
  for (const int64_t key_points : {1, 2}) {
    double samples = 0, all_samples = 0;
    for (int64_t seed = 1; seed <= 8; seed++) {
      INFO(key_points << " key points, seed " << seed);
      torch::manual_seed(seed);
      const auto field = SmoothField(key_points, 0, 12);
      auto renderer = MakeRenderer(key_points);
      const FrameStates states = field->States(torch::tensor({1}, torch::kInt64));
      ImageOptions options;
      options.background = torch::rand({3});
      const RenderedImage fast = RenderImage(*field, renderer, MakeCamera(), states, options);
      options.exact = true;
      const RenderedImage exact = RenderImage(*field, renderer, MakeCamera(), states, options);
      REQUIRE(exact.rgb.std().item<double>() > 0.02);
      const auto error = (fast.rgb - exact.rgb).abs();
      CHECK(Largest(error) < 5 * kLevel);  // a single pixel where a ray grazes a front
      CHECK((error > kLevel).to(torch::kFloat32).mean().item<double>() < 1e-3);
      CHECK(error.mean().item<double>() < 0.1 * kLevel);
      CHECK(Largest(fast.opacity - exact.opacity) < 5 * kLevel);
      CHECK((fast.depth_valid != exact.depth_valid).to(torch::kFloat32).mean().item<double>() < 2e-3);
      const auto both = torch::logical_and(fast.depth_valid, exact.depth_valid);
      const auto moved = ((fast.depth - exact.depth).abs() > 1e-6).logical_and(both).sum().item<double>();
      CHECK(moved <= 1e-2 * static_cast<double>(both.numel()));
      samples += static_cast<double>(fast.samples);
      all_samples += static_cast<double>(exact.samples);
    }
    CHECK(samples < 0.9 * all_samples);
  }
}

TEST_CASE("a picture without the kernels is the same, exact or not") {
  const torch::NoGradGuard no_grad;
  torch::manual_seed(4);
  const auto field = SmoothField(1, 0, 12, "modules");
  auto renderer = MakeRenderer(1);
  const FrameStates states = field->States(torch::tensor({0}, torch::kInt64));
  ImageOptions options;
  const RenderedImage one = RenderImage(*field, renderer, MakeCamera(), states, options);
  options.exact = true;
  const RenderedImage other = RenderImage(*field, renderer, MakeCamera(), states, options);
  CHECK(torch::equal(one.rgb, other.rgb));
  CHECK(one.samples == other.samples);
}

TEST_CASE("colours that are left out change a ray by no more than the share that was allowed") {
  const torch::NoGradGuard no_grad;
  torch::manual_seed(6);
  const auto field = SmoothField(2, 0, 12);
  auto renderer = MakeRenderer(2);
  const RayBatch rays = RaysOf(300);
  RayOptions options;
  const RayResult exact = renderer.Render(*field, rays, AllStates(*field), options);
  int64_t samples = exact.samples;
  for (const double share : {1.0 / 256, 1.0 / 16, 0.5}) {
    INFO(share);
    options.color_error = share;
    const RayResult fewer = renderer.Render(*field, rays, AllStates(*field), options);
    CHECK(Largest(fewer.rgb - exact.rgb) <= share);
    CHECK(torch::equal(fewer.opacity, exact.opacity));
    CHECK(fewer.samples < samples);
    samples = fewer.samples;
  }
}

TEST_CASE("a ray that starts where it first meets something shows the same, and says so where it starts too late") {
  const torch::NoGradGuard no_grad;
  torch::manual_seed(6);
  const auto field = SmoothField(2, 3, 25);
  auto renderer = MakeRenderer(2);
  const RayBatch rays = RaysOf(300);
  RayOptions options;
  options.background = torch::tensor({0.2F, 0.4F, 0.9F});
  const RayResult all = renderer.Render(*field, rays, AllStates(*field), options);
  const auto meets = all.front.isfinite();
  REQUIRE(meets.sum().item<int64_t>() > 100);
  options.start = all.front;
  const RayResult same = renderer.Render(*field, rays, AllStates(*field), options);
  CHECK(Largest(same.rgb - all.rgb) < 1.0 / 255);
  const double step = (kFar - kNear) / 160;
  options.start = all.depth.nan_to_num(kFar) + 4 * step;  // inside what is opaque
  const RayResult late = renderer.Render(*field, rays, AllStates(*field), options);
  const auto inside = torch::logical_and(all.depth_valid, late.front.isfinite());
  REQUIRE(inside.sum().item<int64_t>() > 20);
  CHECK((late.front < 0).sum().item<int64_t>() > inside.sum().item<int64_t>() / 2);
  options.start = torch::full({300}, std::numeric_limits<float>::infinity());
  const RayResult nothing = renderer.Render(*field, rays, AllStates(*field), options);
  CHECK(torch::equal(nothing.rgb, options.background.expand({300, 3})));
  CHECK(nothing.samples == 0);
  CHECK(torch::isinf(nothing.front).all().item<bool>());
}
