#include "libeditnerf/kernels/kernel_use.h"

#include <torch/types.h>
#include <torch/utils.h>

#include "libeditnerf/field/hyperspace_field.h"
#include "libeditnerf/render/ray_renderer.h"
#include "tests/catch.h"
#include "tests/kernels/each_target.h"
#include "tests/kernels/fused_field_fixture.h"

using namespace editnerf;

namespace {

// The kernels of the modules and those of all in one pass, against LibTorch's operations alone.
void CheckAgainstPlain(int64_t key_points) {
  INFO(key_points << " key points");
  Setting setting;
  setting.key_points = key_points;
  setting.turning = key_points > 0;
  const auto field = MakeField(setting);
  RayRenderer renderer = MakeRenderer(*field, setting);
  const RayBatch rays = RandomRays(setting.rays);
  const RayObjective objective = ObjectiveFor(setting);
  const RayOptions options = RandomOptions(setting.rays);
  const Found exact = ModuleByModule(*field, renderer, rays, options, objective, torch::kFloat64);
  const Found modules = ModuleByModule(*field, renderer, rays, options, objective, torch::kFloat32);
  const Found fused = Fused(*field, renderer, rays, options, objective);
  const PlainOperations only;
  CHECK_FALSE(field->Fused());
  const Found plain = ModuleByModule(*field, renderer, rays, options, objective, torch::kFloat32);
  for (const Found* const kernels : {&modules, &fused}) {
    INFO((kernels == &fused ? "fused" : "module by module"));
    CHECK(kernels->samples == plain.samples);
    CHECK(kernels->reconstruction == Approx(plain.reconstruction).epsilon(1e-5));
    CHECK(kernels->distortion == Approx(plain.distortion).epsilon(1e-5));
    CheckGradients(kernels->gradients, plain.gradients, exact.gradients);
  }
}

}  // namespace

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
  for (int64_t key_points = 0; key_points <= 8; ++key_points) CheckAgainstPlain(key_points);
}

TEST_CASE("plain LibTorch operations differentiate the same field as the kernels of every instruction set") {
  ForEachTarget([] {
    torch::manual_seed(21);
    for (const int64_t key_points : {0, 1}) CheckAgainstPlain(key_points);
  });
}
