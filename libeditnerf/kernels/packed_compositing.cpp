#include "libeditnerf/kernels/packed_compositing.h"

#include <torch/csrc/autograd/custom_function.h>
#include <torch/types.h>

#include <algorithm>
#include <cmath>
#include <initializer_list>
#include <limits>

#include "libeditnerf/base/error.h"
#include "libeditnerf/base/parallel.h"
#include "libeditnerf/base/shape.h"

namespace editnerf {
namespace {

using torch::autograd::AutogradContext;
using torch::autograd::variable_list;
using OptionalTensor = c10::optional<at::Tensor>;

constexpr int64_t kGrain = 64;  // rays

// body(ray, begin, end) with the samples of each ray.
template <class Body>
void ForEachRay(const at::Tensor& offsets, const Body& body) {
  const int64_t* const offset = offsets.data_ptr<int64_t>();
  ParallelFor(offsets.size(0) - 1, kGrain, [&](int64_t first, int64_t last) {
    for (int64_t ray = first; ray < last; ++ray) body(ray, offset[ray], offset[ray + 1]);
  });
}

template <class T>
T* Data(const at::Tensor& tensor) {
  return tensor.defined() ? tensor.data_ptr<T>() : nullptr;
}

at::Tensor Contiguous(const at::Tensor& tensor) { return tensor.defined() ? tensor.contiguous() : tensor; }

template <class T>
double Dot(const T* a, const T* b) {
  return static_cast<double>(a[0]) * b[0] + static_cast<double>(a[1]) * b[1] + static_cast<double>(a[2]) * b[2];
}

class CompositeFunction : public torch::autograd::Function<CompositeFunction> {
 public:
  static variable_list forward(AutogradContext* context, const at::Tensor& density, const at::Tensor& delta,
                               const at::Tensor& offsets, const OptionalTensor& radiance,
                               const OptionalTensor& background) {
    const int64_t rays = offsets.size(0) - 1;
    const at::Tensor colors = radiance.value_or(at::Tensor()), backgrounds = background.value_or(at::Tensor());
    const at::Tensor weights = torch::empty_like(density), passing = torch::empty_like(density);
    const at::Tensor transparency = torch::empty({rays}, density.options()), opacity = torch::empty_like(transparency);
    const at::Tensor rgb = colors.defined() ? torch::empty({rays, 3}, density.options()) : at::Tensor();
    AT_DISPATCH_FLOATING_TYPES(density.scalar_type(), "CompositePacked", [&] {
      const auto *const sigma = Data<scalar_t>(density), *const length = Data<scalar_t>(delta),
                        *const color = Data<scalar_t>(colors), *const behind = Data<scalar_t>(backgrounds);
      auto *const weight = Data<scalar_t>(weights), *const pass = Data<scalar_t>(passing),
                  *const last = Data<scalar_t>(transparency), *const opaque = Data<scalar_t>(opacity),
                  *const out = Data<scalar_t>(rgb);
      ForEachRay(offsets, [&](int64_t ray, int64_t begin, int64_t end) {
        double thickness = 0, light = 1, sum[3] = {};
        for (int64_t s = begin; s < end; ++s) {
          const double tau = static_cast<double>(sigma[s]) * static_cast<double>(length[s]);
          const double w = light * -std::expm1(-tau);
          thickness += tau;
          light = std::exp(-thickness);
          weight[s] = static_cast<scalar_t>(w);
          pass[s] = static_cast<scalar_t>(light);
          for (int c = 0; color != nullptr && c < 3; ++c) sum[c] += w * color[3 * s + c];
        }
        last[ray] = static_cast<scalar_t>(light);
        opaque[ray] = static_cast<scalar_t>(-std::expm1(-thickness));
        for (int c = 0; out != nullptr && c < 3; ++c) {
          out[3 * ray + c] = static_cast<scalar_t>(sum[c] + (behind != nullptr ? light * behind[3 * ray + c] : 0));
        }
      });
    });
    context->save_for_backward({delta, offsets, colors, backgrounds, weights, passing, transparency});
    context->set_materialize_grads(false);
    if (!rgb.defined()) return {weights, transparency, opacity};
    return {weights, transparency, opacity, rgb};
  }

  // With g_i the gradient that arrives in w_i, directly and through the colour, T_i+1 the light behind sample i, and
  // T the light behind all: dL/dtau_i = g_i T_i+1 - sum_{j>i} g_j w_j + T (dL/dopacity - dL/dT).
  static variable_list backward(AutogradContext* context, variable_list grads) {
    const auto saved = context->get_saved_variables();
    const at::Tensor &delta = saved[0], &offsets = saved[1], &colors = saved[2], &backgrounds = saved[3];
    const at::Tensor &weights = saved[4], &passing = saved[5], &transparency = saved[6];
    const at::Tensor grad_weights = Contiguous(grads[0]), grad_transparency = Contiguous(grads[1]),
                     grad_opacity = Contiguous(grads[2]);
    const at::Tensor grad_rgb = grads.size() > 3 ? Contiguous(grads[3]) : at::Tensor();
    at::Tensor grad_density = torch::empty_like(weights), grad_radiance, grad_background;
    // The number of an input counts the defined ones alone.
    if (grad_rgb.defined() && context->needs_input_grad(3)) grad_radiance = torch::empty_like(colors);
    if (grad_rgb.defined() && backgrounds.defined() && context->needs_input_grad(4)) {
      grad_background = torch::empty_like(backgrounds);
    }
    AT_DISPATCH_FLOATING_TYPES(weights.scalar_type(), "CompositePackedBackward", [&] {
      const auto *const length = Data<scalar_t>(delta), *const color = Data<scalar_t>(colors),
                        *const behind = Data<scalar_t>(backgrounds), *const weight = Data<scalar_t>(weights),
                        *const pass = Data<scalar_t>(passing), *const last = Data<scalar_t>(transparency),
                        *const in_weights = Data<scalar_t>(grad_weights),
                        *const in_last = Data<scalar_t>(grad_transparency),
                        *const in_opaque = Data<scalar_t>(grad_opacity), *const in_rgb = Data<scalar_t>(grad_rgb);
      auto *const to_density = Data<scalar_t>(grad_density), *const to_color = Data<scalar_t>(grad_radiance),
                  *const to_behind = Data<scalar_t>(grad_background);
      ForEachRay(offsets, [&](int64_t ray, int64_t begin, int64_t end) {
        const scalar_t* const g_rgb = in_rgb != nullptr ? in_rgb + 3 * ray : nullptr;
        double end_light = in_opaque != nullptr ? in_opaque[ray] : 0;
        if (in_last != nullptr) end_light -= in_last[ray];
        if (g_rgb != nullptr && behind != nullptr) end_light -= Dot(g_rgb, behind + 3 * ray);
        end_light *= last[ray];
        double later = 0;
        for (int64_t s = end - 1; s >= begin; --s) {
          double g = in_weights != nullptr ? in_weights[s] : 0;
          if (g_rgb != nullptr) g += Dot(g_rgb, color + 3 * s);
          to_density[s] = static_cast<scalar_t>(length[s] * (g * pass[s] - later + end_light));
          later += g * weight[s];
          for (int c = 0; to_color != nullptr && c < 3; ++c) to_color[3 * s + c] = weight[s] * g_rgb[c];
        }
        for (int c = 0; to_behind != nullptr && c < 3; ++c) to_behind[3 * ray + c] = last[ray] * g_rgb[c];
      });
    });
    return {grad_density, at::Tensor(), at::Tensor(), grad_radiance, grad_background};
  }
};

class DistortionFunction : public torch::autograd::Function<DistortionFunction> {
 public:
  static at::Tensor forward(AutogradContext* context, const at::Tensor& weights, const at::Tensor& t,
                            const at::Tensor& delta, const at::Tensor& offsets) {
    at::Tensor loss = torch::empty({offsets.size(0) - 1}, weights.options());
    AT_DISPATCH_FLOATING_TYPES(weights.scalar_type(), "PackedDistortion", [&] {
      const auto *const weight = Data<scalar_t>(weights), *const position = Data<scalar_t>(t),
                        *const length = Data<scalar_t>(delta);
      auto* const out = Data<scalar_t>(loss);
      ForEachRay(offsets, [&](int64_t ray, int64_t begin, int64_t end) {
        double before = 0, moment = 0, sum = 0;  // of the weights and of w t
        for (int64_t s = begin; s < end; ++s) {
          const double w = weight[s], x = static_cast<double>(position[s]) - position[begin];
          sum += w * (2 * (x * before - moment) + w * length[s] / 3);
          before += w;
          moment += w * x;
        }
        out[ray] = static_cast<scalar_t>(sum);
      });
    });
    context->save_for_backward({weights, t, delta, offsets});
    return loss;
  }

  // dL/dw_i = 2 sum_j w_j |t_i - t_j| + 2/3 w_i d_i
  static variable_list backward(AutogradContext* context, variable_list grads) {
    const auto saved = context->get_saved_variables();
    const at::Tensor &weights = saved[0], &t = saved[1], &delta = saved[2], &offsets = saved[3];
    const at::Tensor grad_loss = grads[0].contiguous(), grad_weights = torch::empty_like(weights);
    AT_DISPATCH_FLOATING_TYPES(weights.scalar_type(), "PackedDistortionBackward", [&] {
      const auto *const weight = Data<scalar_t>(weights), *const position = Data<scalar_t>(t),
                        *const length = Data<scalar_t>(delta), *const in = Data<scalar_t>(grad_loss);
      auto* const out = Data<scalar_t>(grad_weights);
      ForEachRay(offsets, [&](int64_t ray, int64_t begin, int64_t end) {
        // sum_j w_j |x_i - x_j| = x_i (before - behind) + (moment behind - moment before); the signed sums are kept.
        double signed_weight = 0, signed_moment = 0;
        for (int64_t s = begin; s < end; ++s) {
          signed_weight -= weight[s];
          signed_moment -= weight[s] * (static_cast<double>(position[s]) - position[begin]);
        }
        for (int64_t s = begin; s < end; ++s) {
          const double w = weight[s], x = static_cast<double>(position[s]) - position[begin];
          signed_weight += w;
          signed_moment += w * x;
          out[s] = static_cast<scalar_t>(in[ray] * 2 * (x * signed_weight - signed_moment + w * length[s] / 3));
          signed_weight += w;
          signed_moment += w * x;
        }
      });
    });
    return {grad_weights, at::Tensor(), at::Tensor(), at::Tensor()};
  }
};

// Contiguous, defined and of the type of `like` (float32 or float64), or an error.
at::Tensor Checked(const at::Tensor& tensor, std::initializer_list<int64_t> shape, const at::Tensor& like,
                   const char* name) {
  CheckShape(tensor, shape, name);
  const auto type = like.scalar_type();
  if (!tensor.is_cpu() || tensor.scalar_type() != type || (type != torch::kFloat32 && type != torch::kFloat64)) {
    Throw<ShapeError>("packed {}: expected float32 or float64 on the CPU, one type for all, found {}", name,
                      tensor.toString());
  }
  return tensor.contiguous();
}

at::Tensor CheckedOffsets(const at::Tensor& offsets, int64_t samples) {
  CheckShape(offsets, {kAny}, "offsets");
  if (!offsets.is_cpu() || offsets.scalar_type() != torch::kInt64) {
    Throw<ShapeError>("packed offsets: expected int64 on the CPU, found {}", offsets.toString());
  }
  at::Tensor contiguous = offsets.contiguous();
  const int64_t entries = offsets.size(0), last = entries > 0 ? contiguous.data_ptr<int64_t>()[entries - 1] : -1;
  if (last != samples) Throw<ShapeError>("packed offsets: expected {} as the last, found {}", samples, last);
  return contiguous;
}

}  // namespace

PackedPicture CompositePacked(const at::Tensor& density, const at::Tensor& delta, const at::Tensor& offsets,
                              const at::Tensor& radiance, const at::Tensor& background) {
  CheckShape(density, {kAny}, "density");
  const int64_t count = density.size(0);
  const at::Tensor ends = CheckedOffsets(offsets, count);
  OptionalTensor colors, backgrounds;
  if (radiance.defined()) colors = Checked(radiance, {count, 3}, density, "radiance");
  if (radiance.defined() && background.defined()) {
    CheckLastDim(background, 3, "background");
    backgrounds = Checked(background.expand({ends.size(0) - 1, 3}), {kAny, 3}, density, "background");
  }
  const auto outputs = CompositeFunction::apply(Checked(density, {count}, density, "density"),
                                                Checked(delta, {count}, density, "delta"), ends, colors, backgrounds);
  return {outputs[0], outputs[1], outputs[2], radiance.defined() ? outputs[3] : at::Tensor()};
}

PackedSurface FindPackedSurface(const at::Tensor& weights, const at::Tensor& t, const at::Tensor& offsets) {
  CheckShape(weights, {kAny}, "weights");
  const int64_t count = weights.size(0);
  const at::Tensor own_weights = Checked(weights, {count}, weights, "weights"),
                   own_t = Checked(t, {count}, weights, "t"), ends = CheckedOffsets(offsets, count);
  const auto options = t.options().requires_grad(false);
  PackedSurface surface;
  surface.sample = torch::empty({ends.size(0) - 1}, options.dtype(torch::kInt64));
  surface.depth = torch::empty({ends.size(0) - 1}, options);
  surface.valid = torch::empty({ends.size(0) - 1}, options.dtype(torch::kBool));
  AT_DISPATCH_FLOATING_TYPES(weights.scalar_type(), "FindPackedSurface", [&] {
    const auto *const weight = Data<scalar_t>(own_weights), *const position = Data<scalar_t>(own_t);
    auto* const depth = Data<scalar_t>(surface.depth);
    auto* const sample = Data<int64_t>(surface.sample);
    auto* const valid = Data<bool>(surface.valid);
    ForEachRay(ends, [&](int64_t ray, int64_t begin, int64_t end) {
      double sum = 0;
      int64_t s = begin;
      while (s < end && static_cast<scalar_t>(sum += weight[s]) < scalar_t(0.5)) ++s;  // rounded as cumsum does it
      valid[ray] = s < end;
      sample[ray] = std::min(s, count - 1);
      depth[ray] = s < end ? position[s] : std::numeric_limits<scalar_t>::quiet_NaN();
    });
  });
  return surface;
}

at::Tensor PackedDistortion(const at::Tensor& weights, const at::Tensor& t, const at::Tensor& delta,
                            const at::Tensor& offsets) {
  CheckShape(weights, {kAny}, "weights");
  const int64_t count = weights.size(0);
  return DistortionFunction::apply(Checked(weights, {count}, weights, "weights"), Checked(t, {count}, weights, "t"),
                                   Checked(delta, {count}, weights, "delta"), CheckedOffsets(offsets, count));
}

}  // namespace editnerf
