#include "libeditnerf/base/shape.h"

#include <torch/types.h>

#include "libeditnerf/base/error.h"
#include "tests/catch.h"

using namespace editnerf;

TEST_CASE("shape checks name the tensor and both shapes") {
  const auto tensor = torch::zeros({4, 3});
  CHECK_NOTHROW(CheckShape(tensor, {kAny, 3}, "x"));
  CHECK_THROWS_WITH(CheckShape(tensor, {kAny, 2}, "x"), "x: expected shape [*, 2], found [4, 3]");
  CHECK_THROWS_WITH(CheckShape({}, {1}, "x"), "x: expected shape [1], found undefined");
  CHECK_THROWS_AS(CheckLastDim(torch::zeros({}), 3, "x"), ShapeError);
}
