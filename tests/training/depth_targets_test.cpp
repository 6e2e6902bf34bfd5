#include "libeditnerf/training/depth_targets.h"

#include <torch/types.h>

#include "libeditnerf/base/error.h"
#include "libeditnerf/base/safetensors.h"
#include "tests/catch.h"
#include "tests/imaging/scratch_folder.h"

using namespace editnerf;

namespace {

DepthTargets Some() {
  return {torch::tensor({0, 2}, torch::kInt64), torch::tensor({1, 2, 3, 4}, torch::kInt64).view({2, 2}),
          torch::tensor({0.5F, 0.7F}), torch::tensor({0.01F, 0.02F}), torch::tensor({kStandsStill, int64_t{1}})};
}

DepthTargets None() {
  return {torch::zeros({0}, torch::kInt64), torch::zeros({0, 2}, torch::kInt64), torch::zeros({0}), torch::zeros({0}),
          torch::zeros({0}, torch::kInt64)};
}

}  // namespace

TEST_CASE("known distances are joined, empty ones and none included") {
  CHECK(Joined(Some(), Some()).size() == 4);
  CHECK(Joined(Some(), {}).size() == 2);
  CHECK(Joined({}, Some()).size() == 2);
  CHECK(Joined(None(), {}).distance.defined());  // can be written
}

TEST_CASE("known distances come back from their file") {
  const ScratchFolder scratch;
  const auto path = scratch.path() / "known_depth.safetensors";
  WriteDepthTargets(path, Some());
  const DepthTargets back = ReadDepthTargets(path, 3, 10, 10, 2);
  CHECK(torch::equal(back.frame, Some().frame));
  CHECK(torch::equal(back.pixel, Some().pixel));
  CHECK(torch::equal(back.distance, Some().distance));
  CHECK(torch::equal(back.tolerance, Some().tolerance));
  CHECK(torch::equal(back.key_point, Some().key_point));
  WriteDepthTargets(path, None());
  CHECK(ReadDepthTargets(path, 3, 10, 10, 2).size() == 0);
}

TEST_CASE("known distances that do not fit the scene, or are none, are refused by the file's name") {
  const ScratchFolder scratch;
  const auto path = scratch.path() / "known_depth.safetensors";
  WriteDepthTargets(path, Some());
  CHECK_THROWS_WITH(ReadDepthTargets(path, 2, 10, 10, 2), HasText("known_depth.safetensors"));  // frame 2
  CHECK_THROWS_AS(ReadDepthTargets(path, 3, 4, 10, 2), DataError);                              // row 4
  CHECK_THROWS_WITH(ReadDepthTargets(path, 3, 10, 10, 1), HasText("none of the 1"));
  DepthTargets broken = Some();
  broken.distance[1] = NAN;
  WriteDepthTargets(path, broken);
  CHECK_THROWS_WITH(ReadDepthTargets(path, 3, 10, 10, 2), HasText("not finite"));
  broken = Some();
  broken.pixel = broken.frame;
  WriteDepthTargets(path, broken);
  CHECK_THROWS_WITH(ReadDepthTargets(path, 3, 10, 10, 2), HasText("expected frame [M]"));
  WriteSafetensors(path, {{"frame", Some().frame}});
  CHECK_THROWS_WITH(ReadDepthTargets(path, 3, 10, 10, 2), HasText("found no tensor"));
}
