#include "libeditnerf/training/weight_average.h"

#include <torch/types.h>
#include <torch/utils.h>

#include <cmath>
#include <limits>

#include "libeditnerf/base/error.h"
#include "tests/catch.h"
#include "tests/training/small_training.h"

using namespace editnerf;

namespace {

torch::Tensor Row(std::initializer_list<float> values) { return torch::tensor(std::vector<float>(values)); }

std::vector<torch::Tensor> Copies(const HyperspaceField& field) {
  std::vector<torch::Tensor> copies;
  for (const torch::Tensor& weights : field.parameters()) copies.push_back(weights.detach().clone());
  return copies;
}

bool Same(const std::vector<torch::Tensor>& a, const std::vector<torch::Tensor>& b) {
  for (size_t i = 0; i < a.size(); ++i) {
    if (!torch::equal(a[i], b[i])) return false;
  }
  return a.size() == b.size();
}

Run SmallRun(bool average) {
  torch::manual_seed(3);
  Config config = SmallFast();
  config.train.average_weights = average;
  return MakeRun(config, FieldStage::kTrain, TinyScene(), TrueTracks(TinyScene()), torch::kCPU);
}

}  // namespace

TEST_CASE("the mean of weights counts about the last fifth of them") {
  torch::Tensor x = torch::zeros({1});
  WeightAverage average({{"x", x}});
  average.Show();
  CHECK(x.item<float>() == 0);  // nothing was added
  constexpr int kNumber = 1000;
  double mean = 0;
  for (int n = 1; n <= kNumber; ++n) {
    x.fill_(n);
    average.Add();
    mean += 9.0 / (8.0 + n) * (n - mean);
  }
  average.Show();
  CHECK(std::abs(x.item<float>() - mean) < 1e-2);
  CHECK(mean > 0.88 * kNumber);  // of weights that grow evenly: the middle of a window of a fifth
  CHECK(mean < 0.92 * kNumber);
  average.Show();
  average.Hide();
  CHECK(x.item<float>() == kNumber);
}

TEST_CASE("whoever has derived something from the weights sees that the mean is shown") {
  torch::Tensor x = torch::ones({4});
  WeightAverage average({{"x", x}});
  average.Add();
  x.fill_(2);
  const auto version = x._version();
  const float* const memory = x.data_ptr<float>();
  average.Show();
  CHECK(x._version() > version);
  CHECK(x.data_ptr<float>() == memory);
}

TEST_CASE("a mean that is not finite is forgotten and the weights stay") {
  torch::Tensor x = Row({1, std::numeric_limits<float>::quiet_NaN()});
  WeightAverage average({{"x", x}});
  average.Add();
  x.copy_(Row({3, 4}));
  average.Show();
  CHECK(torch::equal(x, Row({3, 4})));
  CHECK(average.State().empty());
  average.Add();
  average.Show();
  CHECK(torch::equal(x, Row({3, 4})));
}

TEST_CASE("a saved mean goes on with the weights behind it, and says what is missing") {
  torch::Tensor x = Row({1, 2});
  WeightAverage average({{"x", x}});
  for (const float value : {1.0F, 5.0F, 7.0F}) {
    x.fill_(value);
    average.Add();
  }
  average.Show();
  torch::Tensor y = x.clone();
  const SavedState state = average.State();
  WeightAverage other({{"x", y}});
  other.LoadState(state);
  CHECK(torch::equal(y, Row({7, 7})));
  average.Hide();
  for (auto [weights, mean] : {std::pair(&x, &average), std::pair(&y, &other)}) {
    weights->fill_(9);
    mean->Add();
    mean->Show();
  }
  CHECK(torch::equal(x, y));

  SavedState broken = state;
  broken.erase("count");
  CHECK_THROWS_WITH(other.LoadState(broken), "training state: 'count' is missing");
  broken = state;
  broken["weights.x"] = torch::ones({3});
  CHECK_THROWS_WITH(other.LoadState(broken), "training state: 'weights.x': expected shape [2], found [3]");
  other.LoadState({});
  other.Show();
  CHECK(other.State().empty());
}

TEST_CASE("averaging changes what a run shows, not how it trains") {
  const Run with = SmallRun(true), without = SmallRun(false);
  const auto trainer_of = [](const Run& run) { return Trainer(run, TinyScene(), std::nullopt, Scratch("average")); };
  torch::manual_seed(3);
  Trainer plain = trainer_of(without);
  for (int i = 0; i < 20; ++i) plain.Step();
  plain.ShowAverage();
  torch::manual_seed(3);
  Trainer averaged = trainer_of(with);
  for (int i = 0; i < 20; ++i) {
    averaged.Step();
    if (i == 11) averaged.ShowAverage();
  }
  CHECK(Same(Copies(*with.field), Copies(*without.field)));
  averaged.ShowAverage();
  CHECK_FALSE(Same(Copies(*with.field), Copies(*without.field)));
}
