#include "libeditnerf/evaluation/lpips.h"

#include <torch/types.h>
#include <torch/utils.h>

#include "libeditnerf/base/error.h"
#include "libeditnerf/base/pth_archive.h"
#include "tests/catch.h"
#include "tests/shared_data.h"

using namespace editnerf;

namespace {

// What the two published files would hold, with arbitrary values.
void MakeWeights(std::map<std::string, torch::Tensor>* backbone, std::map<std::string, torch::Tensor>* linear) {
  torch::manual_seed(3);
  Lpips model;
  for (const auto& parameter : model->named_parameters()) {
    const auto values = torch::rand_like(parameter.value());
    if (parameter.key().rfind("head", 0) == 0) {
      (*linear)["lin" + parameter.key().substr(4) + ".model.1.weight"] = values;
    } else {
      (*backbone)[parameter.key()] = (values - 0.5) * 0.2;
    }
  }
}

}  // namespace

TEST_CASE("LPIPS has the published number of weights") {
  Lpips model;
  int64_t count = 0;
  for (const auto& parameter : model->parameters()) count += parameter.numel();
  CHECK(count == 722496 + 64 + 128 + 256 + 384 + 384 + 512 + 512);
}

TEST_CASE("LPIPS is zero for identical images, symmetric, and grows with the difference") {
  std::map<std::string, torch::Tensor> backbone, linear;
  MakeWeights(&backbone, &linear);
  Lpips model;
  model->Load(backbone, linear, "test");
  torch::manual_seed(4);
  const auto a = torch::rand({40, 56, 3}), noise = torch::randn({40, 56, 3});
  const auto near = (a + 0.02 * noise).clamp(0, 1), far = (a + 0.2 * noise).clamp(0, 1);
  CHECK(model->Distance(a, a) == 0);
  CHECK(model->Distance(a, far) == Approx(model->Distance(far, a)).epsilon(1e-4));
  CHECK(model->Distance(a, near) > 0);
  CHECK(model->Distance(a, far) > model->Distance(a, near));
}

TEST_CASE("LPIPS accepts backbone names with and without a prefix, and names what is missing") {
  std::map<std::string, torch::Tensor> backbone, prefixed, linear;
  MakeWeights(&backbone, &linear);
  for (const auto& [name, tensor] : backbone) prefixed["features." + name] = tensor;
  prefixed["classifier.1.weight"] = torch::zeros({1000, 512, 1, 1});
  Lpips first, second;
  first->Load(backbone, linear, "test");
  second->Load(prefixed, linear, "test");
  const auto a = torch::rand({17, 17, 3}), b = torch::rand({17, 17, 3});
  CHECK(first->Distance(a, b) == second->Distance(a, b));

  linear["lin3.model.1.weight"] = torch::zeros({1, 385, 1, 1});
  CHECK_THROWS_WITH(first->Load(backbone, linear, "w.pth"),
                    "w.pth: tensor 'lin3.model.1.weight' has shape [1, 385, 1, 1], expected [1, 384, 1, 1]");
  backbone.erase("9.squeeze.weight");
  CHECK_THROWS_WITH(first->Load(backbone, linear, "w.pth"),
                    "w.pth: no tensor '9.squeeze.weight': not the weights of LPIPS v0.1 with SqueezeNet 1.1");
}

TEST_CASE("LPIPS refuses images that are too small or of different size") {
  Lpips model;
  const auto small = torch::rand({16, 40, 3});
  CHECK_THROWS_WITH(model->Distance(small, small),
                    "LPIPS needs at least 17 pixels along each side, found an image of 40 x 16");
  CHECK_THROWS_AS(model->Distance(torch::rand({20, 20, 3}), torch::rand({20, 21, 3})), ShapeError);
}

TEST_CASE("LPIPS gradients reach the images") {
  Lpips model;
  const auto a = torch::rand({1, 3, 20, 20}).requires_grad_(true), b = torch::rand({1, 3, 20, 20});
  model->forward(a, b).sum().backward();
  CHECK(torch::isfinite(a.grad()).all().item<bool>());
  CHECK(a.grad().abs().sum().item<double>() > 0);
}
