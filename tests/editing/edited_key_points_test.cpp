#include "libeditnerf/editing/edited_key_points.h"

#include <torch/types.h>

#include "libeditnerf/base/error.h"
#include "tests/catch.h"

using namespace editnerf;

TEST_CASE("an edit replaces the key points that it names and no others") {
  const auto key_points = torch::arange(9, torch::kFloat32).view({3, 3});
  const auto edited = EditedKeyPoints({std::nullopt, Vec3{7, 8, 9}}, key_points);
  CHECK(torch::equal(edited[0], key_points[0]));
  CHECK(torch::equal(edited[1], torch::tensor({7.f, 8.f, 9.f})));
  CHECK(torch::equal(edited[2], key_points[2]));
  CHECK(key_points[1][0].item<float>() == 3);
  CHECK(torch::equal(EditedKeyPoints({}, key_points), key_points));
  CHECK_THROWS_WITH(EditedKeyPoints({{}, {}, {}, Vec3{}}, key_points),
                    "edit: key point 3 is named, but there are only 3, numbered from 0");
}

TEST_CASE("the nearest frame is judged by the named key points alone") {
  auto tracks = torch::zeros({4, 2, 3});
  tracks.select(1, 0).select(1, 0).copy_(torch::arange(4));      // first key point moves along x
  tracks.select(1, 1).select(1, 1).copy_(3 - torch::arange(4));  // second comes back along y
  const auto by_first = NearestKeyPoints({Vec3{2.2, 0, 0}}, tracks);
  CHECK(by_first.row == 2);
  CHECK(by_first.distance == Approx(0.2).epsilon(1e-6));
  CHECK(NearestKeyPoints({std::nullopt, Vec3{0, 2.9, 0}}, tracks).row == 0);
  CHECK_THROWS_WITH(NearestKeyPoints({std::nullopt}, tracks),
                    "edit: no key point is named; give a position or a code_frame");
}
