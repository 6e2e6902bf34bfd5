#include "libeditnerf/field/density_activation.h"

#include <ATen/ATen.h>

namespace editnerf {

torch::Tensor DensityFromPreactivation(const torch::Tensor& y) {
  constexpr double kIdentityAbove = 40;  // exp(-40) is below float64's rounding of 40, and exp(40) fits a float32
  return torch::softplus(y, 1, kIdentityAbove);
}

}  // namespace editnerf
