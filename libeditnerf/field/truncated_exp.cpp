#include "libeditnerf/field/truncated_exp.h"

#include <ATen/ATen.h>
#include <torch/csrc/autograd/custom_function.h>

namespace editnerf {
namespace {

class TruncatedExpFunction : public torch::autograd::Function<TruncatedExpFunction> {
 public:
  static at::Tensor forward(torch::autograd::AutogradContext* context, const at::Tensor& x) {
    at::Tensor value = x.clamp(-kMaxLogDensity, kMaxLogDensity).exp();
    context->save_for_backward({value});
    return value;
  }
  static torch::autograd::variable_list backward(torch::autograd::AutogradContext* context,
                                                 torch::autograd::variable_list grads) {
    return {grads[0] * context->get_saved_variables()[0]};
  }
};

}  // namespace

at::Tensor TruncatedExp(const at::Tensor& x) { return TruncatedExpFunction::apply(x); }

}  // namespace editnerf
