// Adam's update of one parameter in one pass, float32 on the CPU; SIMD chosen at run time (Highway), threaded.
#pragma once

#include <cstdint>

namespace editnerf {

struct AdamUpdate {
  float beta1 = 0, beta2 = 0;
  float rate = 0;   // learning rate / (1 - beta1^steps)
  float scale = 0;  // 1 / sqrt(1 - beta2^steps)
  float epsilon = 0;
};

//   first <- beta1 first + (1 - beta1) g,  second <- beta2 second + (1 - beta2) g^2
//   parameter <- parameter - rate first / (sqrt(second) scale + epsilon)
void AdamStep(const AdamUpdate& update, int64_t count, const float* gradient, float* parameter, float* first,
              float* second);

// The same for a table of which a step touches some entries: those with a gradient of exactly 0 are left alone, moments
// included, and the gradient is zero afterwards, so that nobody has to clear all of it.
void SparseAdamStep(const AdamUpdate& update, int64_t count, float* gradient, float* parameter, float* first,
                    float* second);

// Sum of squares; not finite where a value or its square, which Adam takes too, is not.
double SumOfSquares(const float* values, int64_t count);

}  // namespace editnerf
