#include "libeditnerf/tracking/optical_flow.h"

#include "libeditnerf/base/error.h"
#include "libeditnerf/tracking/flow_sequence.h"
#include "moving_spheres.h"
#include "tests/catch.h"

using namespace editnerf;

namespace {

// A texture that moves by (dx, dy) pixels a frame.
torch::Tensor Shifted(int64_t frames, double dx, double dy) {
  const torch::Tensor rows = torch::arange(96, torch::kFloat64).view({1, -1, 1, 1});
  const torch::Tensor columns = torch::arange(128, torch::kFloat64).view({1, 1, -1, 1});
  const torch::Tensor t = torch::arange(frames, torch::kFloat64).view({-1, 1, 1, 1});
  const torch::Tensor u = columns - dx * t, v = rows - dy * t;
  const torch::Tensor value =
      torch::sin(0.35 * u + 0.1 * v) + torch::sin(0.3 * v - 0.13 * u) + torch::sin(0.11 * u + 0.17 * v);
  return (value * 35 + 120).to(torch::kUInt8).expand({-1, -1, -1, 3}).contiguous();
}

}  // namespace

TEST_CASE("dense inverse search measures a shift to a tenth of a pixel") {
  const torch::Tensor images = Shifted(2, 2.3, -1.4);
  const torch::Tensor flow = DisFlow().Flow(images[0], images[1]);
  REQUIRE(flow.sizes() == torch::IntArrayRef({96, 128, 2}));
  CHECK(flow.scalar_type() == torch::kFloat32);
  const torch::Tensor inner = flow.slice(0, 12, 84).slice(1, 12, 116);
  CHECK((inner.select(2, 0) - 2.3).abs().mean().item<double>() < 0.1);
  CHECK((inner.select(2, 1) + 1.4).abs().mean().item<double>() < 0.1);
}

TEST_CASE("flow sequences hold both directions, are checked, and do not depend on the order of the work") {
  const torch::Tensor images = Shifted(4, 1.5, 0.5);
  const DisFlow flow;
  const FlowSequence a = ComputeFlowSequence(images, flow), b = ComputeFlowSequence(images, flow);
  CHECK(a.num_frames() == 4);
  CHECK(torch::equal(a.forward, b.forward));
  CHECK(torch::equal(a.backward, b.backward));
  CHECK(torch::equal(a.forward[2], flow.Flow(images[2], images[3])));
  CHECK(a.forward_valid.to(torch::kFloat32).mean().item<double>() > 0.85);
  CHECK(a.forward.slice(1, 12, 84).slice(2, 12, 116).select(3, 0).mean().item<double>() == Approx(1.5).margin(0.1));
  CHECK(a.backward.slice(1, 12, 84).slice(2, 12, 116).select(3, 0).mean().item<double>() == Approx(-1.5).margin(0.1));
}

TEST_CASE("forward and backward flow must agree, be finite and stay inside the image") {
  torch::Tensor forward = torch::zeros({20, 20, 2}), backward = torch::zeros({20, 20, 2});
  forward.select(2, 0).fill_(3);
  backward.select(2, 0).fill_(-3);
  backward.slice(0, 10, 20).slice(1, 0, 20).select(2, 0).fill_(1);  // the lower half disagrees
  forward[4][4][1] = NAN;
  const torch::Tensor valid = ForwardBackwardValid(forward, backward);
  CHECK(valid[2][2].item<bool>());
  CHECK_FALSE(valid[15][2].item<bool>());
  CHECK_FALSE(valid[4][4].item<bool>());
  CHECK_FALSE(valid[2][18].item<bool>());
}

TEST_CASE("optical flow refuses images of different sizes and tiny ones") {
  const DisFlow flow;
  CHECK_THROWS_AS(flow.Flow(torch::zeros({32, 32, 3}, torch::kUInt8), torch::zeros({32, 30, 3}, torch::kUInt8)),
                  ShapeError);
  CHECK_THROWS_AS(flow.Flow(torch::zeros({32, 32, 3}), torch::zeros({32, 32, 3})), ShapeError);
  CHECK_THROWS_AS(flow.Flow(torch::zeros({8, 32, 3}, torch::kUInt8), torch::zeros({8, 32, 3}, torch::kUInt8)),
                  DataError);
  CHECK_THROWS_AS(ComputeFlowSequence(torch::zeros({1, 32, 32, 3}, torch::kUInt8), flow), DataError);
}
