// The kernels of kernel_benchmark.h, ready to be called.
#pragma once

#include <functional>
#include <string>
#include <vector>

#include "libeditnerf/config/config.h"

namespace editnerf {

struct KernelCase {
  std::string name;
  double count = 0;       // samples of a call; of Adam: parameters
  double operations = 0;  // of a sample; 0: not counted
  std::function<void()> kernel, reference;
  double peak = 0;  // operations per second of a core; 0: float32's
};

// The kernels that work on tensors alone: encoding, network, compositing, marching, Adam.
std::vector<KernelCase> TensorKernelCases(const Config& config, int64_t samples);

// What bfloat16 gains over float32, by each unit that this processor has.
std::vector<KernelCase> Bf16KernelCases(const Config& config, int64_t samples);

// The whole fast field: density, rays shown, and rays differentiated, fused and module by module.
std::vector<KernelCase> FieldKernelCases(const Config& config, int64_t samples);

// Operations of one sample: of a hash encoding of this many levels with two features, and of a network's layers.
double EncodingOperations(int64_t levels);
double NetworkOperations(const std::vector<int64_t>& widths);

}  // namespace editnerf
