#include "libeditnerf/tracking/still_depth.h"

#include "libeditnerf/tracking/still_flow.h"
#include "libeditnerf/tracking/still_points.h"
#include "moving_spheres.h"
#include "tests/catch.h"

using namespace editnerf;

namespace {

Clip ClipOf(const MovingSpheres& spheres) {
  const FlowSequence flows = ComputeFlowSequence(
      spheres.scene.images.index_select(0, torch::tensor(spheres.scene.train, torch::kInt64)), DisFlow());
  return MakeClip(spheres.scene, spheres.maps.depth, flows);
}

const MovingSpheres& SlidingAndResting() {
  static const MovingSpheres spheres = RenderMovingSpheres(
      {Sliding({-0.35, 0.1, 0.2}, {0.25, 0.1, 0}, 1.5, 30), Resting({0.45, 0.0, 0.2})}, ClipOptions());
  return spheres;
}

}  // namespace

TEST_CASE("flow between still images of a moving camera gives the static scene's depth, and leaves out what moves") {
  const MovingSpheres& spheres = SlidingAndResting();
  const Clip clip = ClipOf(spheres);
  const DepthTargets targets = TriangulateStillDepth(clip, 0.3, 6);
  REQUIRE(targets.size() > 30 * 50);
  const torch::Tensor u = targets.pixel.select(1, 0), v = targets.pixel.select(1, 1);
  const torch::Tensor truth = spheres.maps.depth.index({targets.frame, v, u});
  const torch::Tensor error = torch::nan_to_num((targets.distance / truth - 1).abs(), 1.0);
  const torch::Tensor moving = spheres.part.index({targets.frame, v, u}) == 0;
  const torch::Tensor on_static = error.masked_select(~moving);
  INFO("median " << on_static.median().item<double>() << ", on the moving part " << moving.sum().item<int64_t>());
  CHECK(on_static.median().item<double>() < 0.015);
  CHECK(on_static.quantile(0.9).item<double>() < 0.04);
  const double share = moving.to(torch::kFloat32).mean().item<double>();
  const double visible = (spheres.part == 0).to(torch::kFloat32).mean().item<double>();
  CHECK(share < 0.25 * visible);
  CHECK(targets.tolerance.min().item<double>() > 0);
}

TEST_CASE("without parallax no distance is known") {
  ClipOptions options;
  options.frames = 8;
  options.arc = 0;
  const MovingSpheres spheres = RenderMovingSpheres({Resting({0, 0, 0.2})}, options);
  CHECK(TriangulateStillDepth(ClipOf(spheres), 0.3, 6).size() == 0);
}

TEST_CASE(
    "a pixel of the static scene has a still point at its depth, and texture decides in which direction it counts") {
  const MovingSpheres& spheres = SlidingAndResting();
  const Clip clip = ClipOf(spheres);
  int found = 0;
  double worst = 0;
  for (double v = 70; v < 110; v += 8) {
    for (double u = 60; u < 100; u += 8) {
      const Pixel p = {u, v};
      const int64_t t = 15;
      if (spheres.part[t][static_cast<int64_t>(v)][static_cast<int64_t>(u)].item<int64_t>() == 0) continue;
      const Texture texture = TextureAround(clip.gray[15], p);
      const Chain chain = FollowFlow(clip, t, p, 8);
      if (!texture.Enough() || chain.empty()) continue;
      for (size_t i = 1; i < chain.frame.size(); ++i)
        CHECK(std::abs(chain.frame[i] - t) <= std::abs(chain.frame[i - 1] - t));
      const StillPoint still = FindStillPoint(clip, t, p, {0.3, 6}, chain, texture);
      if (!(still.precision < 0.1)) continue;
      const double truth = spheres.maps.depth[t][static_cast<int64_t>(v)][static_cast<int64_t>(u)].item<double>();
      worst = std::max(worst, std::abs(still.distance / truth - 1));
      ++found;
    }
  }
  CHECK(found >= 5);
  CHECK(worst < 0.1);
  const torch::Tensor columns = torch::arange(32, torch::kFloat32).mul(10).expand({32, 32}).contiguous();
  const Texture across = TextureAround(columns, {16, 16});
  CHECK(across.xx == Approx(100));
  CHECK(across.yy == Approx(0));
  CHECK_FALSE(TextureAround(torch::full({32, 32}, 7.0F), {16, 16}).Enough());
}

TEST_CASE("still flow is the motion of the projections, with the median where there is no depth") {
  const MovingSpheres& spheres = SlidingAndResting();
  const Camera &a = spheres.scene.frames[0].camera, &b = spheres.scene.frames[6].camera;
  torch::Tensor depth = spheres.maps.depth[0].clone();
  depth[40][60] = NAN;
  const torch::Tensor flow = StillFlow(a, depth, b);
  CHECK(flow.isfinite().all().item<bool>());
  const double d = depth[90][80].item<double>();
  const Projected there = Project(b, a.position + a.DirectionThrough(80.5, 90.5) * d);
  CHECK(flow[90][80][0].item<double>() == Approx(there.u - 80.5).margin(1e-4));
  CHECK(flow[90][80][1].item<double>() == Approx(there.v - 90.5).margin(1e-4));
  const torch::Tensor nothing = StillFlow(a, torch::full_like(depth, NAN), b);
  CHECK((nothing == 0).all().item<bool>());
}

TEST_CASE("a guess brings large motions within reach of the flow") {
  const MovingSpheres& spheres = SlidingAndResting();
  const Camera &a = spheres.scene.frames[0].camera, &b = spheres.scene.frames[20].camera;
  const torch::Tensor truth = StillFlow(a, spheres.maps.depth[0], b);
  const torch::Tensor still = (spheres.part[0] < 0).logical_and(spheres.part[20] < 0);
  const auto error = [&](const torch::Tensor& flow) {
    return (flow - truth).norm(2, 2).masked_select(still).median().item<double>();
  };
  const DisFlow dis;
  const double plain = error(dis.Flow(spheres.scene.images[0], spheres.scene.images[20]));
  const double guided = error(dis.FlowFrom(spheres.scene.images[0], spheres.scene.images[20], truth));
  INFO("plain " << plain << ", guided " << guided);
  CHECK(guided < 1);
  CHECK(guided < plain + 0.05);
}
