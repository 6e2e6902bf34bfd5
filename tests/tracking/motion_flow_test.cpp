#include "libeditnerf/tracking/motion_flow.h"

#include "libeditnerf/base/error.h"
#include "tests/catch.h"

using namespace editnerf;

namespace {

constexpr int64_t kHeight = 48, kWidth = 64, kSquare = 20;

torch::Tensor Texture(int64_t height, int64_t width, int64_t seed) {
  torch::manual_seed(seed);
  return torch::randint(256, {height, width, 1}).to(torch::kUInt8).expand({-1, -1, 3});
}

// A square at the given column before a background that stands still.
torch::Tensor SquareAt(int64_t column) {
  torch::Tensor image = Texture(kHeight, kWidth, 1).contiguous();
  image.slice(0, 14, 14 + kSquare).slice(1, column, column + kSquare).copy_(Texture(kSquare, kSquare, 2));
  return image;
}

torch::Tensor Uniform(double du) {
  torch::Tensor flow = torch::zeros({kHeight, kWidth, 2});
  flow.select(2, 0).fill_(du);
  return flow;
}

// The square's inner pixels, of [H, W, 2].
torch::Tensor Inside(const torch::Tensor& flow, int64_t column) {
  return flow.slice(0, 18, 10 + kSquare).slice(1, column + 4, column + kSquare - 4);
}

// Believes what it is told.
class Believer : public OpticalFlow {
 public:
  std::string Name() const override { return "guess"; }
  torch::Tensor Flow(const torch::Tensor&, const torch::Tensor&) const override { return Uniform(0); }
  torch::Tensor FlowFrom(const torch::Tensor&, const torch::Tensor&, const torch::Tensor& guess) const override {
    return guess;
  }
};

}  // namespace

TEST_CASE("each pixel takes the guess under which its surroundings look alike") {
  const torch::Tensor best = MostAlike(SquareAt(10), SquareAt(19), {Uniform(0), Uniform(9)});
  CHECK(torch::equal(Inside(best, 10), Inside(Uniform(9), 10)));
  CHECK(torch::equal(best.slice(0, 0, 8), Uniform(0).slice(0, 0, 8)));
  CHECK(torch::equal(MostAlike(SquareAt(10), SquareAt(10), {Uniform(0), Uniform(0)}), Uniform(0)));
  CHECK_THROWS_AS(MostAlike(SquareAt(10), SquareAt(19), {torch::zeros({kHeight, 3, 2})}), ShapeError);
}

TEST_CASE("a part that was followed once is followed on, forwards and backwards in time") {
  const torch::Tensor images = torch::stack({SquareAt(5), SquareAt(14), SquareAt(23), SquareAt(32)});
  const Believer flow;
  for (const int64_t known : {0, 2}) {
    FlowSequence sequence;
    sequence.forward = torch::zeros({3, kHeight, kWidth, 2});
    sequence.backward = torch::zeros({3, kHeight, kWidth, 2});
    Inside(sequence.forward[known], 5 + 9 * known).select(2, 0).fill_(9);
    Inside(sequence.backward[known], 14 + 9 * known).select(2, 0).fill_(-9);
    // A pixel of the square in frame 1 has its way from frame 0, or to where the next pair's way begins.
    const FlowSequence carried = CarryMotionOn(images, flow, sequence);
    CHECK(carried.num_frames() == 4);
    if (known == 0) CHECK(Inside(carried.forward[1], 14).select(2, 0).mean().item<double>() == Approx(9));
    if (known == 2) CHECK(Inside(carried.backward[1], 23).select(2, 0).mean().item<double>() == Approx(-9));
    CHECK(carried.forward[1].slice(0, 0, 8).abs().max().item<double>() == 0);
  }
}
