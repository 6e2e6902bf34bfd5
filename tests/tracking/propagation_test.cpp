#include "libeditnerf/tracking/propagation.h"

#include <cmath>
#include <functional>

#include "libeditnerf/base/error.h"
#include "moving_spheres.h"
#include "tests/catch.h"

using namespace editnerf;

namespace {

// Flow that answers from a formula: images carry their frame number in pixel (0, 0).
class ScriptedFlow : public OpticalFlow {
 public:
  explicit ScriptedFlow(std::function<Pixel(int64_t from, int64_t to)> shift) : shift_(std::move(shift)) {}
  std::string Name() const override { return "scripted"; }
  torch::Tensor Flow(const torch::Tensor& from, const torch::Tensor& to) const override {
    const Pixel d = shift_(from[0][0][0].item<int64_t>(), to[0][0][0].item<int64_t>());
    torch::Tensor flow = torch::zeros({from.size(0), from.size(1), 2});
    flow.select(2, 0).fill_(d.u);
    flow.select(2, 1).fill_(d.v);
    return flow;
  }

 private:
  std::function<Pixel(int64_t, int64_t)> shift_;
};

// Images whose texture moves by one pixel a frame to the right, at depth 2 before a resting camera.
struct Script {
  explicit Script(int64_t frames, const OpticalFlow& flow) {
    scene.images = torch::zeros({frames, 64, 96, 3}, torch::kUInt8);
    const torch::Tensor rows = torch::arange(64, torch::kFloat64).view({-1, 1}),
                        columns = torch::arange(96, torch::kFloat64);
    for (int64_t t = 0; t < frames; ++t) {
      const torch::Tensor u = columns - static_cast<double>(t);
      const torch::Tensor value = torch::sin(0.4 * u + 0.02 * u * u / 10) + torch::sin(0.5 * rows + 0.2 * u);
      scene.images[t].copy_((value * 50 + 120).to(torch::kUInt8).unsqueeze(2).expand({64, 96, 3}));
      scene.images[t][0][0][0] = t;
      SceneFrame frame;
      frame.id = std::to_string(t);
      frame.camera.width = 96;
      frame.camera.height = 64;
      frame.camera.focal_length = 100;
      frame.camera.principal_point = {48, 32};
      scene.frames.push_back(frame);
      scene.train.push_back(t);
    }
    depth = torch::full({frames, 64, 96}, 2.0f);
    flows = ComputeFlowSequence(scene.images, flow);
  }
  Scene scene;
  torch::Tensor depth;
  FlowSequence flows;
};

PropagationOptions SkipEvery(int64_t interval) {
  PropagationOptions options;
  options.skip_interval = interval;
  options.skip_max_error = 1.5;
  return options;
}

}  // namespace

TEST_CASE("depth look-ups take one surface, the expected or the near one") {
  torch::Tensor depth = torch::full({9, 9}, 2.0f);
  depth.slice(1, 5, 9).fill_(3);
  depth[4][4] = NAN;
  CHECK(LocalDepth(depth, {4.5, 4.5}, 2) == Approx(2));
  CHECK(LocalDepth(depth, {4.5, 4.5}, 2, 3.1) == Approx(3));
  CHECK(LocalDepth(depth, {8.5, 4.5}, 1) == Approx(3));
  CHECK(std::isnan(LocalDepth(depth, {4.5, 4.5}, 0)));
  CHECK(std::isnan(LocalDepth(depth, {9.5, 4.5}, 1)));
  CHECK(std::isnan(LocalDepth(depth, {NAN, 4.5}, 1)));
}

TEST_CASE("flow look-ups interpolate, leave out what is not finite and tell checked from unchecked") {
  torch::Tensor flow = torch::zeros({4, 4, 2});
  flow.select(2, 0).copy_(torch::arange(4, torch::kFloat32).expand({4, 4}));
  torch::Tensor mask = torch::ones({4, 4}, torch::kBool);
  CHECK(SampleFlow(flow, mask, {2.0, 1.0}).du == Approx(1.5));
  flow[0][2][0] = NAN;
  CHECK(SampleFlow(flow, mask, {2.2, 0.5}).valid == false);
  CHECK(SampleFlow(flow, mask, {1.8, 0.5}).du == Approx(1));
  mask.slice(1, 0, 2).fill_(false);
  CHECK(SampleFlow(flow, mask, {1.0, 2.0}).valid);
  CHECK_FALSE(SampleFlow(flow, mask, {1.0, 2.0}).checked);
  CHECK_FALSE(SampleFlow(flow, mask, {4.1, 2.0}).valid);
}

TEST_CASE("chaining follows flow both ways and loses points that leave the image") {
  const ScriptedFlow flow([](int64_t from, int64_t to) { return Pixel{static_cast<double>(to - from), 0}; });
  const Script script(24, flow);
  const Clip clip = MakeClip(script.scene, script.depth, script.flows);
  const PixelTrack track = Propagate(clip, nullptr, 10, {85.5, 30.5}, {});
  CHECK(track.pixel[0].u == Approx(75.5));
  CHECK(track.pixel[19].u == Approx(94.5));
  CHECK(track.visible[0]);
  CHECK(track.distance[5] == Approx(2));
  CHECK_FALSE(track.visible[22]);
  CHECK(std::isnan(track.distance[22]));
  CHECK(track.CountVisible() < 24);
  CHECK_THROWS_AS(Propagate(clip, nullptr, 0, {-1, 5}, {}), ShapeError);
}

TEST_CASE("skipping propagation replaces a chain that drifted, and corrects the frames between") {
  // Neighbouring frames' flow is off by 0.2 pixels a frame; direct flow over ten frames is right.
  const ScriptedFlow flow([](int64_t from, int64_t to) {
    const auto d = static_cast<double>(to - from);
    return Pixel{std::abs(d) == 1 ? 1.2 * d : d, 0};
  });
  const Script script(31, flow);
  const Clip clip = MakeClip(script.scene, script.depth, script.flows);
  DirectFlows direct(clip, flow);
  const PixelTrack chained = Propagate(clip, nullptr, 0, {40.5, 30.5}, SkipEvery(10));
  const PixelTrack skipped = Propagate(clip, &direct, 0, {40.5, 30.5}, SkipEvery(10));
  CHECK(chained.pixel[20].u == Approx(64.5));
  CHECK(skipped.pixel[10].u == Approx(50.5));
  CHECK(skipped.pixel[30].u == Approx(70.5));
  CHECK(std::abs(skipped.pixel[19].u - 59.5) < 0.5);
  REQUIRE(skipped.links.size() == 3);
  CHECK(skipped.links[0].frame == 10);
}

TEST_CASE("direct flow with a small forward-backward error is refused where the patch does not match") {
  const ScriptedFlow flow([](int64_t from, int64_t to) {
    const auto d = static_cast<double>(to - from);
    return Pixel{std::abs(d) == 1 ? d : 0.0, 0};  // over long gaps: "nothing moved", consistently both ways
  });
  const Script script(21, flow);
  const Clip clip = MakeClip(script.scene, script.depth, script.flows);
  DirectFlows direct(clip, flow);
  const PixelTrack track = Propagate(clip, &direct, 0, {40.5, 30.5}, SkipEvery(10));
  CHECK(track.links.empty());
  CHECK(track.pixel[20].u == Approx(60.5));
}

TEST_CASE("a point behind something nearer is not visible, and is found again behind it") {
  const ScriptedFlow flow([](int64_t from, int64_t to) { return Pixel{static_cast<double>(to - from), 0}; });
  Script script(24, flow);
  script.depth.slice(0, 8, 13).slice(2, 40, 70).fill_(1.2f);  // an obstacle passes in frames 8 to 12
  script.depth[20].fill_(NAN);
  script.depth[21].fill_(2.8f);  // the depth map misses the part
  const Clip clip = MakeClip(script.scene, script.depth, script.flows);
  DirectFlows direct(clip, flow);
  const PixelTrack track = Propagate(clip, &direct, 0, {40.5, 30.5}, {});
  for (const size_t t : {size_t{8}, size_t{10}, size_t{12}}) CHECK_FALSE(track.visible[t]);
  CHECK(track.visible[7]);
  CHECK(track.visible[16]);
  CHECK(track.pixel[16].u == Approx(56.5));
  CHECK(track.pixel[10].u == Approx(50.5).margin(0.5));
  CHECK(track.visible[20]);
  CHECK(std::isnan(track.distance[20]));
  CHECK(std::isnan(track.distance[21]));
  CHECK(track.distance[22] == Approx(2));
}
