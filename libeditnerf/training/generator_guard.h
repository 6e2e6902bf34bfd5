// LibTorch's default CPU generator, lent: what is drawn meanwhile follows from a seed, and what comes after does not
// change.
#pragma once

#include <ATen/CPUGeneratorImpl.h>

#include <cstdint>

namespace editnerf {

class GeneratorGuard {
 public:
  explicit GeneratorGuard(uint64_t seed)
      : generator_(at::detail::getDefaultCPUGenerator()), state_(generator_.get_state()) {
    generator_.set_current_seed(seed);
  }
  ~GeneratorGuard() { generator_.set_state(state_); }
  GeneratorGuard(const GeneratorGuard&) = delete;
  GeneratorGuard& operator=(const GeneratorGuard&) = delete;

 private:
  at::Generator generator_;
  at::Tensor state_;
};

}  // namespace editnerf
