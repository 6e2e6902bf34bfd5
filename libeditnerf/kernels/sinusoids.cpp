#include "libeditnerf/kernels/sinusoids.h"

#include <ATen/Functions.h>
#include <torch/csrc/autograd/custom_function.h>

#include <algorithm>

#include "libeditnerf/base/parallel.h"
#include "libeditnerf/base/shape.h"
#include "libeditnerf/kernels/kernel_use.h"

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "libeditnerf/kernels/sinusoids.cpp"  // compiled once for every target
// clang-format off
#include <hwy/foreach_target.h>  // before all other headers of Highway
#include <hwy/contrib/math/math-inl.h>
#include <hwy/highway.h>
// clang-format on

HWY_BEFORE_NAMESPACE();
namespace editnerf {
namespace HWY_NAMESPACE {

namespace hn = hwy::HWY_NAMESPACE;

// count: a multiple of 16.
void SinCos(const float* phase, int64_t count, float* sine, float* cosine) {
  const hn::CappedTag<float, 16> tag;
  const auto lanes = static_cast<int64_t>(hn::Lanes(tag));
  for (int64_t i = 0; i < count; i += lanes) {
    const auto x = hn::LoadU(tag, phase + i);
    hn::StoreU(hn::Sin(tag, x), tag, sine + i);
    hn::StoreU(hn::Cos(tag, x), tag, cosine + i);
  }
}

}  // namespace HWY_NAMESPACE
}  // namespace editnerf
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace editnerf {
namespace {

HWY_EXPORT(SinCos);

constexpr int64_t kTile = 256;  // coordinates

void EncodeRows(const float* x, int64_t rows, int64_t dim, const std::vector<float>& weights, bool identity,
                float* out) {
  const auto octaves = static_cast<int64_t>(weights.size());
  const int64_t width = dim * (2 * octaves + (identity ? 1 : 0)), first_wave = identity ? dim : 0;
  float phase[kTile], sine[kTile], cosine[kTile];
  const int64_t rows_per_tile = std::max<int64_t>(kTile / dim, 1);
  for (int64_t begin = 0; begin < rows; begin += rows_per_tile) {
    const int64_t count = std::min(rows_per_tile, rows - begin), values = count * dim;
    const float* const in = x + begin * dim;
    float* const rows_out = out + begin * width;
    if (identity) {
      for (int64_t r = 0; r < count; ++r) std::copy_n(in + r * dim, dim, rows_out + r * width);
    }
    for (int64_t k = 0; k < octaves; ++k) {
      const auto frequency = static_cast<float>(int64_t{1} << k);
      for (int64_t i = 0; i < values; ++i) phase[i] = in[i] * frequency;
      std::fill(phase + values, phase + kTile, 0.0F);
      HWY_DYNAMIC_DISPATCH(SinCos)(phase, (values + 15) / 16 * 16, sine, cosine);
      for (int64_t r = 0; r < count; ++r) {
        float* const wave = rows_out + r * width + first_wave + 2 * k * dim;
        for (int64_t d = 0; d < dim; ++d) {
          wave[d] = weights[static_cast<size_t>(k)] * sine[r * dim + d];
          wave[dim + d] = weights[static_cast<size_t>(k)] * cosine[r * dim + d];
        }
      }
    }
  }
}

// d(w sin(f x)) = f w cos(f x), which the output holds already; so for the cosine.
void GradientRows(const float* out, const float* grad, int64_t rows, int64_t dim, int64_t octaves, bool identity,
                  float* grad_x) {
  const int64_t width = dim * (2 * octaves + (identity ? 1 : 0)), first_wave = identity ? dim : 0;
  for (int64_t r = 0; r < rows; ++r) {
    for (int64_t d = 0; d < dim; ++d) {
      float sum = identity ? grad[r * width + d] : 0.0F;
      for (int64_t k = 0; k < octaves; ++k) {
        const int64_t sine = r * width + first_wave + 2 * k * dim + d, cosine = sine + dim;
        sum += static_cast<float>(int64_t{1} << k) * (grad[sine] * out[cosine] - grad[cosine] * out[sine]);
      }
      grad_x[r * dim + d] = sum;
    }
  }
}

class SinusoidsFunction : public torch::autograd::Function<SinusoidsFunction> {
 public:
  static at::Tensor forward(torch::autograd::AutogradContext* context, const at::Tensor& x,
                            const std::vector<double>& weights, bool identity) {
    const at::Tensor rows = x.contiguous();
    const int64_t dim = rows.size(1);
    const std::vector<float> w(weights.begin(), weights.end());
    const int64_t width = dim * (2 * static_cast<int64_t>(w.size()) + (identity ? 1 : 0));
    at::Tensor out = at::empty({rows.size(0), width}, rows.options());
    ParallelFor(rows.size(0), 1024, [&](int64_t begin, int64_t end) {
      EncodeRows(rows.data_ptr<float>() + begin * dim, end - begin, dim, w, identity,
                 out.data_ptr<float>() + begin * width);
    });
    context->save_for_backward({out});
    context->saved_data["dim"] = dim;
    context->saved_data["octaves"] = static_cast<int64_t>(w.size());
    context->saved_data["identity"] = identity;
    return out;
  }

  static torch::autograd::variable_list backward(torch::autograd::AutogradContext* context,
                                                 torch::autograd::variable_list grads) {
    const at::Tensor out = context->get_saved_variables()[0], grad = grads[0].contiguous();
    const int64_t dim = context->saved_data["dim"].toInt(), octaves = context->saved_data["octaves"].toInt();
    const bool identity = context->saved_data["identity"].toBool();
    const int64_t width = out.size(1);
    at::Tensor grad_x = at::empty({out.size(0), dim}, out.options());
    ParallelFor(out.size(0), 1024, [&](int64_t begin, int64_t end) {
      GradientRows(out.data_ptr<float>() + begin * width, grad.data_ptr<float>() + begin * width, end - begin, dim,
                   octaves, identity, grad_x.data_ptr<float>() + begin * dim);
    });
    return {grad_x, at::Tensor(), at::Tensor()};
  }
};

}  // namespace

bool CanEncodeSinusoids(const at::Tensor& x, const std::vector<float>& weights) {
  return KernelsTake(x) && x.dim() == 2 && x.size(1) <= kTile &&
         static_cast<int64_t>(weights.size()) <= kMostFusedOctaves;
}

at::Tensor EncodeSinusoids(const at::Tensor& x, const std::vector<float>& weights, bool identity) {
  CheckShape(x, {kAny, kAny}, "sinusoids x");
  return SinusoidsFunction::apply(x, std::vector<double>(weights.begin(), weights.end()), identity);
}

}  // namespace editnerf
#endif
