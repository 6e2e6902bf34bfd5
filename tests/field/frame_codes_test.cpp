#include "libeditnerf/field/frame_codes.h"

#include <torch/types.h>

#include "libeditnerf/base/error.h"
#include "tests/catch.h"
#include "tests/gradient_check.h"

using namespace editnerf;

TEST_CASE("codes start uniform in [0, init] and come out by frame") {
  FrameCodes codes(200, 8, 0.05);
  CHECK(codes->table.min().item<double>() >= 0);
  CHECK(codes->table.max().item<double>() <= 0.05);
  CHECK(codes->table.mean().item<double>() == Approx(0.025).epsilon(0.1));
  const auto rows = codes->forward(torch::tensor({7, 7, 199}, torch::kInt64));
  CHECK(rows[1].equal(codes->table[7]));
  CHECK(rows[2].equal(codes->table[199]));
}

TEST_CASE("only the codes that were asked for receive gradients, once per use") {
  FrameCodes codes(4, 2, 0.05);
  codes->to(torch::kFloat64);
  const auto time = torch::tensor({1, 3, 1}, torch::kInt64);
  CHECK(GradientError([&] { return codes->forward(time).square(); }, {codes->table}) < 1e-8);
  CHECK(codes->table.grad()[0].abs().max().item<double>() == 0);
  CHECK(codes->table.grad()[2].abs().max().item<double>() == 0);
}

TEST_CASE("codes refuse frames that do not exist and empty tables") {
  FrameCodes codes(4, 2, 0.05);
  CHECK_THROWS(codes->forward(torch::tensor({4}, torch::kInt64)));
  CHECK_THROWS_WITH(codes->forward(torch::zeros({2, 2}, torch::kInt64)), "time: expected shape [*], found [2, 2]");
  CHECK_THROWS_WITH(FrameCodes(0, 2, 0.1), "frame codes: expected at least one frame and one dimension, found 0 and 2");
}
