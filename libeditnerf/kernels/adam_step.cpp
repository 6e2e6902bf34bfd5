#include "libeditnerf/kernels/adam_step.h"

#include <algorithm>
#include <vector>

#include "libeditnerf/base/parallel.h"

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "libeditnerf/kernels/adam_step.cpp"  // compiled once for every target
#include <hwy/foreach_target.h>
#include <hwy/highway.h>

HWY_BEFORE_NAMESPACE();
namespace editnerf {
namespace HWY_NAMESPACE {

namespace hn = hwy::HWY_NAMESPACE;
using Tag = hn::CappedTag<float, 16>;
using Vector = hn::Vec<Tag>;

// One vector, from `from` on.
HWY_INLINE void UpdateVector(const AdamUpdate& u, Vector g, float* parameter, float* first, float* second) {
  const Tag tag;
  const Vector m = hn::MulAdd(hn::Set(tag, u.beta1), hn::LoadU(tag, first), hn::Mul(hn::Set(tag, 1 - u.beta1), g));
  const Vector v =
      hn::MulAdd(hn::Set(tag, u.beta2), hn::LoadU(tag, second), hn::Mul(hn::Set(tag, 1 - u.beta2), hn::Mul(g, g)));
  const Vector divisor = hn::MulAdd(hn::Sqrt(v), hn::Set(tag, u.scale), hn::Set(tag, u.epsilon));
  const Vector change = hn::Div(hn::Mul(hn::Set(tag, u.rate), m), divisor);
  hn::StoreU(hn::Sub(hn::LoadU(tag, parameter), change), tag, parameter);
  hn::StoreU(m, tag, first);
  hn::StoreU(v, tag, second);
}

// Entries of a vector whose gradient is 0 keep what they have.
HWY_INLINE void UpdateTouched(const AdamUpdate& u, Vector g, float* parameter, float* first, float* second) {
  const Tag tag;
  const auto touched = hn::Ne(g, hn::Zero(tag));
  if (hn::AllFalse(tag, touched)) return;
  const Vector old_parameter = hn::LoadU(tag, parameter), old_first = hn::LoadU(tag, first),
               old_second = hn::LoadU(tag, second);
  UpdateVector(u, g, parameter, first, second);
  if (hn::AllTrue(tag, touched)) return;
  hn::StoreU(hn::IfThenElse(touched, hn::LoadU(tag, parameter), old_parameter), tag, parameter);
  hn::StoreU(hn::IfThenElse(touched, hn::LoadU(tag, first), old_first), tag, first);
  hn::StoreU(hn::IfThenElse(touched, hn::LoadU(tag, second), old_second), tag, second);
}

// body(gradient, parameter, first, second) for whole vectors, the last of which may be a copy.
template <class Body>
HWY_INLINE void ForVectors(int64_t count, const float* gradient, float* parameter, float* first, float* second,
                           const Body& body) {
  const Tag tag;
  const auto lanes = static_cast<int64_t>(hn::Lanes(tag));
  int64_t i = 0;
  for (; i + lanes <= count; i += lanes) body(hn::LoadU(tag, gradient + i), parameter + i, first + i, second + i);
  if (i == count) return;
  float g[16] = {}, p[16] = {}, m[16] = {}, v[16] = {};
  std::copy(gradient + i, gradient + count, g);
  std::copy(parameter + i, parameter + count, p);
  std::copy(first + i, first + count, m);
  std::copy(second + i, second + count, v);
  body(hn::LoadU(tag, g), p, m, v);
  std::copy_n(p, count - i, parameter + i);
  std::copy_n(m, count - i, first + i);
  std::copy_n(v, count - i, second + i);
}

void Dense(const AdamUpdate& u, int64_t count, const float* gradient, float* parameter, float* first, float* second) {
  ForVectors(count, gradient, parameter, first, second,
             [&](Vector g, float* p, float* m, float* v) { UpdateVector(u, g, p, m, v); });
}

void Sparse(const AdamUpdate& u, int64_t count, float* gradient, float* parameter, float* first, float* second) {
  ForVectors(count, gradient, parameter, first, second,
             [&](Vector g, float* p, float* m, float* v) { UpdateTouched(u, g, p, m, v); });
  std::fill_n(gradient, count, 0.0F);
}

double Squares(const float* values, int64_t count) {
  const Tag tag;
  const auto lanes = static_cast<int64_t>(hn::Lanes(tag));
  Vector sum = hn::Zero(tag);
  int64_t i = 0;
  for (; i + lanes <= count; i += lanes) {
    const Vector x = hn::LoadU(tag, values + i);
    sum = hn::MulAdd(x, x, sum);
  }
  double total = hn::GetLane(hn::SumOfLanes(tag, sum));
  for (; i < count; ++i) total += static_cast<double>(values[i] * values[i]);  // in float32, as whole vectors
  return total;
}

}  // namespace HWY_NAMESPACE
}  // namespace editnerf
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace editnerf {

HWY_EXPORT(Dense);
HWY_EXPORT(Sparse);
HWY_EXPORT(Squares);

namespace {
// Entries at a time: their gradient is still in the first-level cache when it is cleared.
constexpr int64_t kBlock = 2048;
constexpr int64_t kGrain = 8 * kBlock;
}  // namespace

void AdamStep(const AdamUpdate& update, int64_t count, const float* gradient, float* parameter, float* first,
              float* second) {
  ParallelFor(count, kGrain, [&](int64_t begin, int64_t end) {
    HWY_DYNAMIC_DISPATCH(Dense)
    (update, end - begin, gradient + begin, parameter + begin, first + begin, second + begin);
  });
}

void SparseAdamStep(const AdamUpdate& update, int64_t count, float* gradient, float* parameter, float* first,
                    float* second) {
  ParallelFor(count, kGrain, [&](int64_t begin, int64_t end) {
    for (int64_t from = begin; from < end; from += kBlock) {
      HWY_DYNAMIC_DISPATCH(Sparse)
      (update, std::min(kBlock, end - from), gradient + from, parameter + from, first + from, second + from);
    }
  });
}

double SumOfSquares(const float* values, int64_t count) {
  const int64_t blocks = (count + kBlock - 1) / kBlock;
  std::vector<double> sums(static_cast<size_t>(blocks));
  ParallelFor(blocks, 8, [&](int64_t first, int64_t last) {
    for (int64_t block = first; block < last; ++block) {
      const int64_t begin = block * kBlock;
      sums[static_cast<size_t>(block)] = HWY_DYNAMIC_DISPATCH(Squares)(values + begin, std::min(kBlock, count - begin));
    }
  });
  double total = 0;
  for (const double sum : sums) total += sum;
  return total;
}

}  // namespace editnerf
#endif
