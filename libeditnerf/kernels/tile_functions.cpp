#include "libeditnerf/kernels/tile_functions.h"

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "libeditnerf/kernels/tile_functions.cpp"  // compiled once for every target
// clang-format off
#include <hwy/foreach_target.h>  // before all other headers of Highway
#include <hwy/contrib/math/math-inl.h>
#include <hwy/highway.h>
// clang-format on

HWY_BEFORE_NAMESPACE();
namespace editnerf {
namespace HWY_NAMESPACE {

namespace hn = hwy::HWY_NAMESPACE;
using Tag = hn::CappedTag<float, 16>;
using Vector = hn::Vec<Tag>;

// body(first column of a vector)
template <class Body>
HWY_INLINE void ForVectors(int64_t count, const Body& body) {
  const auto lanes = static_cast<int64_t>(hn::Lanes(Tag()));
  for (int64_t s = 0; s < count; s += lanes) body(s);
}

HWY_INLINE Vector Row(const float* rows, int64_t row, int64_t s) { return hn::LoadU(Tag(), TileRow(rows, row) + s); }
HWY_INLINE void SetRow(Vector v, float* rows, int64_t row, int64_t s) { hn::StoreU(v, Tag(), TileRow(rows, row) + s); }
HWY_INLINE Vector Broadcast(float x) { return hn::Set(Tag(), x); }

// Bounds that leave a NaN a NaN, so that the step guard sees it; what Min and Max make of one depends on the machine.
HWY_INLINE Vector AtMost(Vector limit, Vector x) { return hn::IfThenElse(hn::Gt(x, limit), limit, x); }
HWY_INLINE Vector AtLeast(Vector limit, Vector x) { return hn::IfThenElse(hn::Lt(x, limit), limit, x); }

// x: finite or NaN, which stays one. Highway's own makes it a whole number on the way, for which C++ has no answer.
HWY_INLINE Vector Exp(Vector x) { return hn::Add(hn::Exp(Tag(), hn::IfThenElseZero(hn::Eq(x, x), x)), hn::Sub(x, x)); }

// Into [0, 1]; a NaN becomes 0.
HWY_INLINE Vector ToUnit(Vector x) {
  const Vector positive = hn::IfThenElseZero(hn::Ge(x, hn::Zero(Tag())), x);
  return hn::Min(positive, Broadcast(1.0F));
}

void UnitCoordinatesImpl(const float* x, const float low[3], float side, int64_t count, float* unit) {
  const Vector divisor = Broadcast(side);
  for (int axis = 0; axis < 3; ++axis) {
    const Vector start = Broadcast(low[axis]);
    ForVectors(count,
               [&](int64_t s) { SetRow(ToUnit(hn::Div(hn::Sub(Row(x, axis, s), start), divisor)), unit, axis, s); });
  }
}

void LocalCoordinatesImpl(const float* x, const float* anchor, float side, float margin, int64_t count, float* unit,
                          float* fade) {
  const Vector divisor = Broadcast(side), half = Broadcast(0.5F), one = Broadcast(1.0F);
  const Vector steepness = Broadcast(1 / margin);
  ForVectors(count, [&](int64_t s) {
    Vector farthest = hn::Zero(Tag());
    for (int axis = 0; axis < 3; ++axis) {
      Vector apart = Row(x, axis, s);
      if (anchor != nullptr) apart = hn::Sub(apart, Row(anchor, axis, s));
      const Vector local = hn::Div(apart, divisor);
      farthest = hn::Max(farthest, hn::Abs(local));
      SetRow(ToUnit(hn::Add(local, half)), unit, axis, s);
    }
    const Vector inside = hn::Sub(one, hn::Add(farthest, farthest));
    SetRow(ToUnit(hn::Mul(inside, steepness)), fade, 0, s);
  });
}

void ScaleRowsByRow(const float* factor, int64_t num_rows, int64_t count, float* rows) {
  for (int64_t r = 0; r < num_rows; ++r) {
    ForVectors(count, [&](int64_t s) { SetRow(hn::Mul(Row(rows, r, s), Row(factor, 0, s)), rows, r, s); });
  }
}

void ScaleRowsByOne(float factor, int64_t num_rows, int64_t count, float* rows) {
  const Vector scale = Broadcast(factor);
  for (int64_t r = 0; r < num_rows; ++r) {
    ForVectors(count, [&](int64_t s) { SetRow(hn::Mul(Row(rows, r, s), scale), rows, r, s); });
  }
}

void EncodeTileImpl(const float* x, int64_t dim, int64_t octaves, float window, int64_t count, float* out) {
  constexpr float kPeriod = 6.283185307179586F;
  const Tag tag;
  const Vector scale = Broadcast(window);
  for (int64_t d = 0; d < dim; ++d) {
    ForVectors(count, [&](int64_t s) {
      const Vector value = Row(x, d, s);
      SetRow(hn::Mul(value, scale), out, d, s);
      // Octaves are whole multiples of the first, so that whole periods may be taken off before they multiply.
      const Vector periods = hn::Round(hn::Mul(value, Broadcast(1 / kPeriod)));
      Vector phase = hn::Sub(value, hn::Mul(periods, Broadcast(kPeriod)));
      // Where x has no digit left of a phase, the difference may be anything, and Highway's sine of it a NaN.
      phase = AtMost(Broadcast(4.0F), AtLeast(Broadcast(-4.0F), phase));
      const Vector unknown = hn::Sub(phase, phase);  // NaN where it is, as in Exp
      phase = hn::IfThenElseZero(hn::Eq(phase, phase), phase);
      for (int64_t k = 0; k < octaves; ++k) {
        const int64_t sine = dim * (1 + 2 * k) + d;
        SetRow(hn::MulAdd(hn::Sin(tag, phase), scale, unknown), out, sine, s);
        SetRow(hn::MulAdd(hn::Cos(tag, phase), scale, unknown), out, sine + dim, s);
        phase = hn::Add(phase, phase);
      }
    });
  }
}

// d(w sin(f x)) = f w cos(f x), which the output holds already; so for the cosine.
void EncodeTileGradientImpl(const float* out, const float* grad, int64_t dim, int64_t octaves, float window,
                            int64_t count, float* grad_x) {
  const Vector scale = Broadcast(window);
  for (int64_t d = 0; d < dim; ++d) {
    ForVectors(count, [&](int64_t s) {
      Vector sum = hn::Mul(Row(grad, d, s), scale);
      for (int64_t k = 0; k < octaves; ++k) {
        const int64_t sine = dim * (1 + 2 * k) + d, cosine = sine + dim;
        const Vector slope =
            hn::Sub(hn::Mul(Row(grad, sine, s), Row(out, cosine, s)), hn::Mul(Row(grad, cosine, s), Row(out, sine, s)));
        sum = hn::MulAdd(Broadcast(static_cast<float>(int64_t{1} << k)), slope, sum);
      }
      SetRow(sum, grad_x, d, s);
    });
  }
}

void DensityOfImpl(const float* x, float bias, float limit, int64_t count, float* density) {
  const Vector shift = Broadcast(bias), high = Broadcast(limit), low = Broadcast(-limit);
  ForVectors(count, [&](int64_t s) {
    const Vector exponent = AtMost(high, AtLeast(low, hn::Add(Row(x, 0, s), shift)));
    SetRow(Exp(exponent), density, 0, s);
  });
}

void SigmoidImpl(int64_t num_rows, int64_t count, float* rows) {
  const Vector one = Broadcast(1.0F);
  for (int64_t r = 0; r < num_rows; ++r) {
    ForVectors(count, [&](int64_t s) {
      const Vector e = Exp(AtMost(Broadcast(80.0F), hn::Neg(Row(rows, r, s))));
      SetRow(hn::Div(one, hn::Add(one, e)), rows, r, s);
    });
  }
}

void SubtractDistancesImpl(const float* x, const float* anchors, int64_t num, int64_t per, float scale, int64_t count,
                           float* logits) {
  const Vector minus = Broadcast(-scale);
  for (int64_t i = 0; i < num; ++i) {
    ForVectors(count, [&](int64_t s) {
      Vector nearest = Broadcast(3e38F);
      for (int64_t a = 0; a < per; ++a) {
        Vector square = hn::Zero(Tag());
        for (int axis = 0; axis < 3; ++axis) {
          const Vector difference = hn::Sub(Row(x, axis, s), Broadcast(anchors[(i * per + a) * 3 + axis]));
          square = hn::MulAdd(difference, difference, square);
        }
        nearest = hn::Min(nearest, square);
      }
      SetRow(hn::MulAdd(minus, hn::Sqrt(nearest), Row(logits, i, s)), logits, i, s);
    });
  }
}

void SoftmaxImpl(int64_t num_rows, int64_t count, float* rows) {
  ForVectors(count, [&](int64_t s) {
    Vector most = Row(rows, 0, s);
    for (int64_t r = 1; r < num_rows; ++r) most = hn::Max(most, Row(rows, r, s));
    Vector sum = hn::Zero(Tag());
    for (int64_t r = 0; r < num_rows; ++r) {
      const Vector e = Exp(AtLeast(Broadcast(-85.0F), hn::Sub(Row(rows, r, s), most)));
      sum = hn::Add(sum, e);
      SetRow(e, rows, r, s);
    }
    for (int64_t r = 0; r < num_rows; ++r) SetRow(hn::Div(Row(rows, r, s), sum), rows, r, s);
  });
}

void SoftmaxGradientImpl(const float* weights, int64_t num_rows, int64_t count, float* grad) {
  ForVectors(count, [&](int64_t s) {
    Vector mean = hn::Zero(Tag());
    for (int64_t r = 0; r < num_rows; ++r) mean = hn::MulAdd(Row(weights, r, s), Row(grad, r, s), mean);
    for (int64_t r = 0; r < num_rows; ++r) {
      SetRow(hn::Mul(Row(weights, r, s), hn::Sub(Row(grad, r, s), mean)), grad, r, s);
    }
  });
}

void WeightedSumImpl(const float* weights, const float* keys, const float* scale, const float* offset, int64_t num,
                     int64_t count, float* anchor, float* ambient) {
  ForVectors(count, [&](int64_t s) {
    for (int axis = 0; axis < 3; ++axis) {
      Vector p = hn::Zero(Tag()), q = hn::Zero(Tag());
      for (int64_t i = 0; i < num; ++i) {
        const Vector w = Row(weights, i, s), k = Row(keys, 3 * i + axis, s);
        p = hn::MulAdd(w, k, p);
        q = hn::MulAdd(w, hn::MulAdd(k, Broadcast(scale[i]), Broadcast(offset[3 * i + axis])), q);
      }
      SetRow(p, anchor, axis, s);
      SetRow(q, ambient, axis, s);
    }
  });
}

void WeightedSumGradientImpl(const float* weights, const float* keys, const float* scale, const float* offset,
                             int64_t num, int64_t count, const float* grad_anchor, const float* grad_ambient,
                             float* grad_weights, float* grad_keys) {
  ForVectors(count, [&](int64_t s) {
    for (int64_t i = 0; i < num; ++i) {
      const Vector w = Row(weights, i, s), stretch = Broadcast(scale[i]);
      Vector sum = hn::Zero(Tag());
      for (int axis = 0; axis < 3; ++axis) {
        const Vector k = Row(keys, 3 * i + axis, s), g = Row(grad_anchor, axis, s), h = Row(grad_ambient, axis, s);
        const Vector q = hn::MulAdd(k, stretch, Broadcast(offset[3 * i + axis]));
        sum = hn::MulAdd(g, k, hn::MulAdd(h, q, sum));
        SetRow(hn::Mul(w, hn::MulAdd(h, stretch, g)), grad_keys, 3 * i + axis, s);
      }
      SetRow(sum, grad_weights, i, s);
    }
  });
}

void SumInFramesImpl(const float* x, const float* weights, const float* keys, const float* frames, int64_t num,
                     int64_t count, float* turned) {
  ForVectors(count, [&](int64_t s) {
    Vector sums[3] = {hn::Zero(Tag()), hn::Zero(Tag()), hn::Zero(Tag())};
    for (int64_t i = 0; i < num; ++i) {
      const Vector w = weights != nullptr ? Row(weights, i, s) : Broadcast(1.0F);
      for (int64_t axis = 0; axis < 3; ++axis) {
        const Vector apart = hn::Mul(w, hn::Sub(Row(x, axis, s), Row(keys, 3 * i + axis, s)));
        for (int64_t own = 0; own < 3; ++own)
          sums[own] = hn::MulAdd(Row(frames, 9 * i + 3 * own + axis, s), apart, sums[own]);
      }
    }
    for (int own = 0; own < 3; ++own) SetRow(sums[own], turned, own, s);
  });
}

void SumInFramesGradientImpl(const float* x, const float* weights, const float* keys, const float* frames, int64_t num,
                             int64_t count, const float* grad, float* grad_weights, float* grad_keys,
                             float* grad_frames) {
  ForVectors(count, [&](int64_t s) {
    const Vector g[3] = {Row(grad, 0, s), Row(grad, 1, s), Row(grad, 2, s)};
    for (int64_t i = 0; i < num; ++i) {
      const Vector w = weights != nullptr ? Row(weights, i, s) : Broadcast(1.0F);
      Vector to_weight = hn::Zero(Tag());
      for (int64_t axis = 0; axis < 3; ++axis) {
        const Vector apart = hn::Sub(Row(x, axis, s), Row(keys, 3 * i + axis, s));
        Vector back = hn::Zero(Tag());  // R transposed times grad
        for (int64_t own = 0; own < 3; ++own) {
          const int64_t entry = 9 * i + 3 * own + axis;
          back = hn::MulAdd(Row(frames, entry, s), g[own], back);
          SetRow(hn::Mul(w, hn::Mul(g[own], apart)), grad_frames, entry, s);
        }
        to_weight = hn::MulAdd(back, apart, to_weight);
        SetRow(hn::NegMulAdd(w, back, Row(grad_keys, 3 * i + axis, s)), grad_keys, 3 * i + axis, s);
      }
      if (grad_weights != nullptr) SetRow(hn::Add(Row(grad_weights, i, s), to_weight), grad_weights, i, s);
    }
  });
}

void AddRowsImpl(const float* a, const float* b, float factor, int64_t num_rows, int64_t count, float* sum) {
  for (int64_t r = 0; r < num_rows; ++r) {
    ForVectors(count, [&](int64_t s) { SetRow(hn::MulAdd(Row(b, r, s), Broadcast(factor), Row(a, r, s)), sum, r, s); });
  }
}

void AddScaledRowsImpl(const float* factor, const float* rows, int64_t num_rows, int64_t count, float* sum) {
  for (int64_t r = 0; r < num_rows; ++r) {
    ForVectors(count,
               [&](int64_t s) { SetRow(hn::MulAdd(Row(rows, r, s), Row(factor, 0, s), Row(sum, r, s)), sum, r, s); });
  }
}

void LightAlongRaysImpl(const float* tau, const float* before, int64_t count, float* light, float* weight) {
  const Tag tag;
  ForVectors(count, [&](int64_t s) {
    // Beyond e^-80 nothing is seen, and the exponential would soon be denormal. It is 0 there, not e^-80: densities of
    // 1e6 would make gradients of that which have no meaning.
    const Vector sum = hn::LoadU(tag, before + s), least = Broadcast(80.0F);
    const Vector arriving = hn::IfThenZeroElse(hn::Gt(sum, least), Exp(hn::Neg(AtMost(least, sum))));
    const Vector alpha = hn::Neg(hn::Expm1(tag, AtLeast(Broadcast(-80.0F), hn::Neg(hn::LoadU(tag, tau + s)))));
    hn::StoreU(arriving, tag, light + s);
    hn::StoreU(hn::Mul(arriving, alpha), tag, weight + s);
  });
}

}  // namespace HWY_NAMESPACE
}  // namespace editnerf
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace editnerf {

HWY_EXPORT(UnitCoordinatesImpl);
HWY_EXPORT(LocalCoordinatesImpl);
HWY_EXPORT(ScaleRowsByRow);
HWY_EXPORT(ScaleRowsByOne);
HWY_EXPORT(EncodeTileImpl);
HWY_EXPORT(EncodeTileGradientImpl);
HWY_EXPORT(DensityOfImpl);
HWY_EXPORT(SigmoidImpl);
HWY_EXPORT(SubtractDistancesImpl);
HWY_EXPORT(SoftmaxImpl);
HWY_EXPORT(SoftmaxGradientImpl);
HWY_EXPORT(WeightedSumImpl);
HWY_EXPORT(WeightedSumGradientImpl);
HWY_EXPORT(SumInFramesImpl);
HWY_EXPORT(SumInFramesGradientImpl);
HWY_EXPORT(AddRowsImpl);
HWY_EXPORT(AddScaledRowsImpl);
HWY_EXPORT(LightAlongRaysImpl);

void UnitCoordinates(const float* x, const float low[3], float side, int64_t count, float* unit) {
  HWY_DYNAMIC_DISPATCH(UnitCoordinatesImpl)(x, low, side, count, unit);
}

void LocalCoordinates(const float* x, const float* anchor, float side, float margin, int64_t count, float* unit,
                      float* fade) {
  HWY_DYNAMIC_DISPATCH(LocalCoordinatesImpl)(x, anchor, side, margin, count, unit, fade);
}

void ScaleRows(const float* factor, int64_t num_rows, int64_t count, float* rows) {
  HWY_DYNAMIC_DISPATCH(ScaleRowsByRow)(factor, num_rows, count, rows);
}

void ScaleRows(float factor, int64_t num_rows, int64_t count, float* rows) {
  HWY_DYNAMIC_DISPATCH(ScaleRowsByOne)(factor, num_rows, count, rows);
}

void EncodeTile(const float* x, int64_t dim, int64_t octaves, float window, int64_t count, float* out) {
  HWY_DYNAMIC_DISPATCH(EncodeTileImpl)(x, dim, octaves, window, count, out);
}

void EncodeTileGradient(const float* out, const float* grad, int64_t dim, int64_t octaves, float window, int64_t count,
                        float* grad_x) {
  HWY_DYNAMIC_DISPATCH(EncodeTileGradientImpl)(out, grad, dim, octaves, window, count, grad_x);
}

void DensityOf(const float* x, float bias, float limit, int64_t count, float* density) {
  HWY_DYNAMIC_DISPATCH(DensityOfImpl)(x, bias, limit, count, density);
}

void Sigmoid(int64_t num_rows, int64_t count, float* rows) { HWY_DYNAMIC_DISPATCH(SigmoidImpl)(num_rows, count, rows); }

void SubtractDistances(const float* x, const float* anchors, int64_t num, int64_t per, float scale, int64_t count,
                       float* logits) {
  HWY_DYNAMIC_DISPATCH(SubtractDistancesImpl)(x, anchors, num, per, scale, count, logits);
}

void Softmax(int64_t num_rows, int64_t count, float* rows) { HWY_DYNAMIC_DISPATCH(SoftmaxImpl)(num_rows, count, rows); }

void SoftmaxGradient(const float* weights, int64_t num_rows, int64_t count, float* grad) {
  HWY_DYNAMIC_DISPATCH(SoftmaxGradientImpl)(weights, num_rows, count, grad);
}

void WeightedSum(const float* weights, const float* keys, const float* scale, const float* offset, int64_t num,
                 int64_t count, float* anchor, float* ambient) {
  HWY_DYNAMIC_DISPATCH(WeightedSumImpl)(weights, keys, scale, offset, num, count, anchor, ambient);
}

void WeightedSumGradient(const float* weights, const float* keys, const float* scale, const float* offset, int64_t num,
                         int64_t count, const float* grad_anchor, const float* grad_ambient, float* grad_weights,
                         float* grad_keys) {
  HWY_DYNAMIC_DISPATCH(WeightedSumGradientImpl)
  (weights, keys, scale, offset, num, count, grad_anchor, grad_ambient, grad_weights, grad_keys);
}

void SumInFrames(const float* x, const float* weights, const float* keys, const float* frames, int64_t num,
                 int64_t count, float* turned) {
  HWY_DYNAMIC_DISPATCH(SumInFramesImpl)(x, weights, keys, frames, num, count, turned);
}

void SumInFramesGradient(const float* x, const float* weights, const float* keys, const float* frames, int64_t num,
                         int64_t count, const float* grad, float* grad_weights, float* grad_keys, float* grad_frames) {
  HWY_DYNAMIC_DISPATCH(SumInFramesGradientImpl)
  (x, weights, keys, frames, num, count, grad, grad_weights, grad_keys, grad_frames);
}

void AddRows(const float* a, const float* b, float factor, int64_t num_rows, int64_t count, float* sum) {
  HWY_DYNAMIC_DISPATCH(AddRowsImpl)(a, b, factor, num_rows, count, sum);
}

void AddScaledRows(const float* factor, const float* rows, int64_t num_rows, int64_t count, float* sum) {
  HWY_DYNAMIC_DISPATCH(AddScaledRowsImpl)(factor, rows, num_rows, count, sum);
}

void LightAlongRays(const float* tau, const float* before, int64_t count, float* light, float* weight) {
  HWY_DYNAMIC_DISPATCH(LightAlongRaysImpl)(tau, before, count, light, weight);
}

}  // namespace editnerf
#endif
