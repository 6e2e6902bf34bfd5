// The kernels of kernel_benchmark.h, ready to be called.
#pragma once

#include <functional>
#include <string>
#include <vector>

#include "libeditnerf/config/config.h"

namespace editnerf {

struct KernelCase {
  std::string name;
  double count = 0;       // samples of a call; of Adam: parameters, or those with a gradient
  double operations = 0;  // of a sample; 0: not counted
  std::function<void()> kernel, reference;
  double peak = 0;  // operations per second of a core; 0: float32's
};

// The kernels that work on tensors alone: encoding, network, compositing, marching, Adam on whole tables and on what a
// step touches of them.
std::vector<KernelCase> TensorKernelCases(const Config& config, int64_t samples);

// What bfloat16 gains over float32, by each unit that this processor has.
std::vector<KernelCase> Bf16KernelCases(const Config& config, int64_t samples);

// The whole fast field with two key points: density, rays shown, and rays differentiated, in one fused pass against
// plain LibTorch operations alone.
std::vector<KernelCase> FieldKernelCases(const Config& config, int64_t samples);

// Rays differentiated by a field with one key point and by fields with fewer and more parts (AllFieldParts), in the
// fused pass of this kernel; the reference of each is the one with one key point.
std::vector<KernelCase> FieldPartCases(const Config& config, const std::string& kernel, int64_t samples);

// What field.fast.kernel can be here: "fp32", and "bf16" where the processor has a unit for it.
std::vector<std::string> FusedKernelsHere();

// Operations of one sample: of a hash encoding of this many levels with two features, and of a network's layers.
double EncodingOperations(int64_t levels);
double NetworkOperations(const std::vector<int64_t>& widths);

}  // namespace editnerf
