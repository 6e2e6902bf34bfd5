#include "libeditnerf/evaluation/flow_error.h"

#include <torch/types.h>

#include <cmath>
#include <limits>

#include "libeditnerf/base/error.h"
#include "libeditnerf/scene/synthetic/synthetic_scene.h"
#include "tests/catch.h"

using namespace editnerf;

namespace {

// Two frames of 40 x 30 pixels: a wall at z = 2 before a camera that moves by 0.1 to the right, focal length 100; in
// its left half an object that moves by 0.04 to the right.
Scene Wall() {
  Scene scene;
  scene.name = "wall";
  scene.images = torch::zeros({2, 30, 40, 3}, torch::kUInt8);
  GroundTruth truth;
  truth.objects = {"poster"};
  truth.depth = torch::empty({2, 30, 40});
  truth.mask = torch::zeros({2, 30, 40}, torch::kUInt8);
  truth.scene_from_object = torch::eye(4, torch::kFloat64).repeat({2, 1, 1, 1});
  truth.scene_from_object[1][0][0][3] = 0.04;
  for (int64_t frame = 0; frame < 2; ++frame) {
    SceneFrame view;
    view.id = std::to_string(frame);
    view.camera.focal_length = 100;
    view.camera.principal_point = {20, 15};
    view.camera.width = 40;
    view.camera.height = 30;
    view.camera.position = {frame == 0 ? 0.0 : 0.1, 0, 0};
    scene.frames.push_back(view);
    scene.train.push_back(frame);
    for (int64_t row = 0; row < 30; ++row) {
      for (int64_t column = 0; column < 40; ++column) {
        const double x = (static_cast<double>(column) - 19.5) / 100, y = (static_cast<double>(row) - 14.5) / 100;
        truth.depth[frame][row][column] = 2 * std::sqrt(1 + x * x + y * y);
      }
    }
  }
  truth.mask[0].slice(1, 0, 20).fill_(1);
  truth.mask[1].slice(1, 0, 17).fill_(1);  // 2 pixels to the right, and 5 to the left
  scene.truth = truth;
  return scene;
}

}  // namespace

TEST_CASE("true flow is what cameras and objects make of the surface") {
  const TrueFlow truth = ComputeTrueFlow(Wall(), 0, 1);
  // 100 pixels * 0.1 / 2 = 5 to the left; on the object 100 * 0.06 / 2 = 3.
  CHECK(truth.flow[10][30][0].item<double>() == Approx(-5).margin(1e-3));
  CHECK(truth.flow[10][30][1].item<double>() == Approx(0).margin(1e-3));
  CHECK(truth.flow[10][10][0].item<double>() == Approx(-3).margin(1e-3));
  CHECK(truth.moving[10][10].item<bool>());
  CHECK_FALSE(truth.moving[10][30].item<bool>());
  CHECK(truth.visible[10][30].item<bool>());
  CHECK(truth.visible[10][10].item<bool>());
  CHECK_FALSE(truth.visible[10][2].item<bool>());   // leaves the image
  CHECK_FALSE(truth.visible[10][20].item<bool>());  // goes behind the object
  CHECK_FALSE(ComputeTrueFlow(Wall(), 0, 0).moving.any().item<bool>());
}

TEST_CASE("along true flow a synthetic scene keeps its colours, and comes back") {
  SyntheticOptions options;
  options.frames = 12;
  options.val_frames = options.edit_frames = 2;
  options.width = 96;
  options.height = 54;
  const Scene scene = MakeSyntheticScene("cups", options);
  const int64_t from = scene.train[3], to = scene.train[4];
  const TrueFlow there = ComputeTrueFlow(scene, from, to), back = ComputeTrueFlow(scene, to, from);
  CHECK(there.moving.any().item<bool>());
  CHECK(there.visible.to(torch::kFloat32).mean().item<double>() > 0.6);
  // Where the flow leads, sampled bilinearly.
  const torch::Tensor x = torch::arange(96, torch::kFloat32) + 0.5, y = torch::arange(54, torch::kFloat32) + 0.5;
  const torch::Tensor place = torch::stack({x.expand({54, 96}), y.view({54, 1}).expand({54, 96})}, 2) + there.flow;
  const torch::Tensor grid = (2 * place / torch::tensor({96.0F, 54.0F}) - 1).unsqueeze(0).nan_to_num(2.0);
  const auto sampled = [&](const torch::Tensor& map) {
    return torch::grid_sampler_2d(map.to(torch::kFloat32).permute({2, 0, 1}).unsqueeze(0).contiguous(), grid, 0, 0,
                                  false)[0]
        .permute({1, 2, 0});
  };
  const torch::Tensor way = (there.flow + sampled(back.flow)).norm(2, 2).masked_select(there.visible);
  CHECK(way.nanmedian().item<double>() < 0.02);
  const auto difference = [&](const torch::Tensor& image, const torch::Tensor& pixels) {
    return (scene.images[from].to(torch::kFloat32) - image).abs().mean(2).masked_select(pixels).median().item<double>();
  };
  for (const torch::Tensor& pixels :
       {there.visible.logical_and(~there.moving), there.visible.logical_and(there.moving)}) {
    const double along = difference(sampled(scene.images[to]), pixels);
    const double still = difference(scene.images[to].to(torch::kFloat32), pixels);
    INFO("along the flow " << along << ", at the same pixel " << still);
    CHECK(along < 0.5 * still);
  }
}

TEST_CASE("flow errors are measured apart for what moves and near edges") {
  const Scene scene = Wall();
  const torch::Tensor truth = ComputeTrueFlow(scene, 0, 1).flow;
  torch::Tensor flow = truth.clone();
  flow.slice(1, 0, 20).select(2, 1) += 0.5;    // the object
  flow.slice(1, 23, 40).select(2, 0) += 0.25;  // the wall away from it
  flow[10][30][0] = std::numeric_limits<float>::quiet_NaN();
  FlowErrors errors(3);
  errors.Add(flow, scene, 0, 1);
  const auto summary = errors.Summary();
  REQUIRE(summary.size() == 4);
  CHECK(summary[0].part == FlowPart::kStatic);
  CHECK(summary[0].median == Approx(0.25).margin(1e-3));
  CHECK(summary[1].part == FlowPart::kStaticEdge);
  CHECK(summary[1].median == Approx(0).margin(1e-3));
  CHECK(summary[2].part == FlowPart::kMoving);
  CHECK(summary[2].median == Approx(0.5).margin(1e-3));
  CHECK(summary[2].percentile90 == Approx(0.5).margin(1e-3));
  CHECK(summary[3].part == FlowPart::kMovingEdge);
  CHECK(summary[3].pixels == 3 * 30);
  CHECK(FlowErrors().Summary().empty());
  CHECK_THROWS_AS(errors.Add(flow.slice(0, 1), scene, 0, 1), ShapeError);
  Scene untold = scene;
  untold.truth.reset();
  CHECK_THROWS_AS(errors.Add(flow, untold, 0, 1), DataError);
}
