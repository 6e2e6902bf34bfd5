#include "libeditnerf/kernels/kernel_use.h"

#include <torch/torch.h>

#include "libeditnerf/field/hyperspace_field.h"
#include "libeditnerf/render/ray_renderer.h"
#include "tests/catch.h"
#include "tests/kernels/fused_field_fixture.h"

using namespace editnerf;

TEST_CASE("kernels take float32 in the CPU's memory, and nothing while plain operations are wanted") {
  CHECK(KernelsTake(torch::zeros({2})));
  CHECK(KernelsTake(torch::Tensor()));
  CHECK_FALSE(KernelsTake(torch::zeros({2}, torch::kFloat64)));
  CHECK_FALSE(KernelsTake({torch::zeros({2}), torch::zeros({2}, torch::kInt64)}));
  {
    const PlainOperations outer;
    {
      const PlainOperations inner;
      CHECK(PlainOperations::Wanted());
    }
    CHECK_FALSE(KernelsTake(torch::zeros({2})));
  }
  CHECK(KernelsTake(torch::zeros({2})));
}

TEST_CASE("plain LibTorch operations differentiate the same field") {
  torch::manual_seed(21);
  for (const int64_t key_points : {0, 1, 2}) {
    Setting setting;
    setting.key_points = key_points;
    setting.turning = key_points > 0;
    const auto field = MakeField(setting);
    RayRenderer renderer = MakeRenderer(*field, setting);
    const RayBatch rays = RandomRays(setting.rays);
    const RayObjective objective = ObjectiveFor(setting);
    const RayOptions options = RandomOptions(setting.rays);
    const Found kernels = ModuleByModule(*field, renderer, rays, options, objective, torch::kFloat32);
    const PlainOperations only;
    CHECK_FALSE(field->Fused());
    const Found plain = ModuleByModule(*field, renderer, rays, options, objective, torch::kFloat32);
    CHECK(plain.samples == kernels.samples);
    CHECK(plain.reconstruction == Approx(kernels.reconstruction).epsilon(1e-5));
    CHECK(plain.distortion == Approx(kernels.distortion).epsilon(1e-5));
    for (const auto& [name, gradient] : kernels.gradients) {
      INFO(name);
      CHECK((plain.gradients.at(name) - gradient).norm().item<double>() <=
            1e-4 * gradient.norm().item<double>() + 1e-9);
    }
  }
}
