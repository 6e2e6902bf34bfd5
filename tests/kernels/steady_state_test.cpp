// What a training step asks the heap for once sizes have settled: nothing for its samples.
#include <torch/types.h>

#include <atomic>
#include <cstdlib>
#include <new>

#include "libeditnerf/kernels/bf16_unit.h"
#include "tests/catch.h"
#include "tests/kernels/fused_field_fixture.h"

namespace {

std::atomic<int64_t> g_blocks{0};

void* Allocate(size_t size, size_t alignment) {
  ++g_blocks;
  const size_t whole = (std::max<size_t>(size, 1) + alignment - 1) / alignment * alignment;
  if (void* const memory = std::aligned_alloc(alignment, whole)) return memory;
  throw std::bad_alloc();
}

}  // namespace

// Every block of this program, those of LibTorch's tensors included: each tensor is an object made with `new`.
void* operator new(size_t size) { return Allocate(size, alignof(std::max_align_t)); }
void* operator new[](size_t size) { return Allocate(size, alignof(std::max_align_t)); }
void* operator new(size_t size, std::align_val_t alignment) { return Allocate(size, static_cast<size_t>(alignment)); }
void* operator new[](size_t size, std::align_val_t alignment) { return Allocate(size, static_cast<size_t>(alignment)); }
void operator delete(void* memory) noexcept { std::free(memory); }
void operator delete[](void* memory) noexcept { std::free(memory); }
void operator delete(void* memory, size_t) noexcept { std::free(memory); }
void operator delete[](void* memory, size_t) noexcept { std::free(memory); }
void operator delete(void* memory, std::align_val_t) noexcept { std::free(memory); }
void operator delete[](void* memory, std::align_val_t) noexcept { std::free(memory); }
void operator delete(void* memory, size_t, std::align_val_t) noexcept { std::free(memory); }
void operator delete[](void* memory, size_t, std::align_val_t) noexcept { std::free(memory); }

using namespace editnerf;

TEST_CASE("the fused pass allocates nothing for rays and samples once sizes have settled") {
  const std::string kernel = FastestBf16() == Bf16Unit::kNone ? "fp32" : GENERATE("fp32", "bf16");
  const int64_t key_points = GENERATE(1, 3);
  INFO(kernel << ", " << key_points << " key points");
  Setting setting;
  setting.kernel = kernel, setting.key_points = key_points, setting.rays = 4096, setting.shade = true;
  const auto field = MakeField(setting);
  RayRenderer renderer = MakeRenderer(*field, setting);
  const RayBatch rays = RandomRays(setting.rays);
  const RayOptions options = RandomOptions(setting.rays);
  const RayObjective objective = ObjectiveFor(setting);
  const FrameStates states = AllStates(*field);
  const auto first_rows = [](torch::Tensor all, int64_t count) { return all.narrow(0, 0, count); };
  struct Step {
    int64_t blocks = 0, samples = 0;
  };
  const auto step = [&](int64_t count) {
    RayOptions own = options;
    for (torch::Tensor* rows : {&own.background, &own.jitter, &own.distance, &own.tolerance}) {
      *rows = first_rows(*rows, count);
    }
    RayObjective few = objective;
    few.target = first_rows(few.target, count);
    const RayBatch batch = {first_rows(rays.origin, count), first_rows(rays.direction, count),
                            first_rows(rays.state, count)};
    const int64_t before = g_blocks;
    const auto result = renderer.AddGradients(*field, batch, states, own, few);
    REQUIRE(result.has_value());
    return Step{g_blocks - before, result->samples};
  };
  for (int i = 0; i < 8; ++i) step(setting.rays);  // whichever thread takes a part: each has seen the largest
  const Step few = step(256), many = step(setting.rays);
  REQUIRE(many.samples > 8 * few.samples);
  INFO(few.blocks << " blocks for few rays, " << many.blocks << " for many");
  CHECK(many.blocks <= few.blocks + 8);
}
