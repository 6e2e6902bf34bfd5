#include "libeditnerf/training/adam.h"

#include <torch/optim.h>
#include <torch/types.h>
#include <torch/utils.h>

#include "libeditnerf/base/error.h"
#include "tests/catch.h"

using namespace editnerf;

namespace {

// At half the rate of 0.02, beside one of LibTorch's optimisers at 0.01.
template <class Reference, class Options>
void CheckSameSteps(double decay, const Options& options) {
  torch::manual_seed(1);
  auto ours = torch::randn({5, 3}, torch::kFloat64).requires_grad_();
  auto theirs = ours.detach().clone().requires_grad_();
  const auto target = torch::randn({5, 3}, torch::kFloat64);
  AdamGroup group;
  group.parameters = {{"x", ours}};
  group.learning_rate_factor = 0.5;
  group.decay = decay;
  Adam adam({group}, {0.9, 0.99, 1e-8});
  Reference reference({theirs}, options);
  for (int step = 0; step < 20; ++step) {
    adam.ZeroGrad();
    (ours - target).pow(2).sum().backward();
    adam.Step(0.02);
    reference.zero_grad();
    (theirs - target).pow(2).sum().backward();
    reference.step();
  }
  CHECK(torch::allclose(ours, theirs, 1e-10, 1e-12));
}

}  // namespace

TEST_CASE("Adam takes the steps that LibTorch's Adam takes, and with decay those of its AdamW") {
  CheckSameSteps<torch::optim::Adam>(0, torch::optim::AdamOptions(0.01).betas({0.9, 0.99}).eps(1e-8));
  CheckSameSteps<torch::optim::AdamW>(3, torch::optim::AdamWOptions(0.01).betas({0.9, 0.99}).eps(1e-8).weight_decay(3));
}

TEST_CASE("what no gradient reaches decays as well") {
  auto table = torch::ones({2, 4}).requires_grad_();
  AdamGroup group;
  group.parameters = {{"table", table}};
  group.skip_untouched = true;
  group.decay = 1;
  Adam adam({group}, {});
  for (int step = 0; step < 3; ++step) {
    adam.ZeroGrad();
    table.select(0, 0).sum().backward();
    adam.Step(0.1);
  }
  CHECK(torch::allclose(table.detach()[1], torch::full({4}, 0.9F * 0.9F * 0.9F)));
}

TEST_CASE("what settles takes the steps of a rate that falls as one over their number") {
  auto settling = torch::ones({3}).requires_grad_();
  auto steady = torch::ones({3}).requires_grad_();
  AdamGroup group;
  group.parameters = {{"settling", settling}};
  group.settle_after = 4;
  Adam adam({group}, {});
  Adam reference({{{{"steady", steady}}}}, {});
  for (int step = 1; step <= 12; ++step) {
    CAPTURE(step);
    for (Adam* each : {&adam, &reference}) each->ZeroGrad();
    (3 * settling).sum().backward();
    (3 * steady).sum().backward();
    adam.Step(0.01);
    reference.Step(step <= 4 ? 0.01 : 0.01 * 4 / step);
    CHECK(torch::allclose(settling, steady, 1e-6));
  }
}

TEST_CASE("Adam leaves untouched entries of a table alone, on either path") {
  for (const bool contiguous : {true, false}) {
    auto table = (contiguous ? torch::ones({2, 4}) : torch::ones({4, 2}).t()).detach().requires_grad_();
    Adam adam({{{{"table", table}}, 1, true}}, {});
    for (int step = 0; step < 3; ++step) {
      adam.ZeroGrad();
      table.select(0, step == 0 ? 0 : 1).sum().backward();
      adam.Step(0.1);
    }
    CHECK(torch::allclose(table.detach()[0], torch::full({4}, 0.9f), 1e-5, 1e-5));
    CHECK((table.detach()[1] < 0.9).all().item<bool>());
  }
}

TEST_CASE("Adam continues from a saved state exactly") {
  const auto run = [](int first_part) {
    torch::manual_seed(2);
    auto x = torch::randn({7}).requires_grad_();
    AdamGroup group;
    group.parameters = {{"x", x}};
    group.settle_after = 2;
    auto adam = std::make_unique<Adam>(std::vector<AdamGroup>{group}, AdamOptions{});
    for (int step = 0; step < 6; ++step) {
      if (step == first_part) {
        std::map<std::string, torch::Tensor> state;
        for (const auto& [name, tensor] : adam->State()) state[name] = tensor.clone();
        adam = std::make_unique<Adam>(std::vector<AdamGroup>{group}, AdamOptions{});
        adam->LoadState(state);
      }
      adam->ZeroGrad();
      x.pow(2).sum().backward();
      adam->Step(0.1);
    }
    return x.detach();
  };
  CHECK(torch::equal(run(-1), run(3)));
}

TEST_CASE("Adam names what a saved state lacks") {
  auto x = torch::zeros({3}).requires_grad_();
  Adam adam({{{{"x", x}}, 1, false}}, {});
  CHECK_THROWS_WITH(adam.LoadState({}), "training state: 'first.x' is missing");
  CHECK_THROWS_WITH(adam.LoadState({{"first.x", torch::zeros({2})}}),
                    "training state: 'first.x': expected shape [3], found [2]");
}
