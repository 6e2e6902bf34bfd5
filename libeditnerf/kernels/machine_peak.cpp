#include "libeditnerf/kernels/machine_peak.h"

#include <algorithm>
#include <atomic>

#include "libeditnerf/base/machine.h"
#include "libeditnerf/base/parallel.h"

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "libeditnerf/kernels/machine_peak.cpp"  // compiled once for every target
#include <hwy/foreach_target.h>
#include <hwy/highway.h>

HWY_BEFORE_NAMESPACE();
namespace editnerf {
namespace HWY_NAMESPACE {

namespace hn = hwy::HWY_NAMESPACE;
using Tag = hn::CappedTag<float, 16>;

// Independent sums: more than the latency of a multiply-add times the units for it, fewer than registers.
constexpr int kSums = 12;

int64_t OperationsPerRound() { return 2 * kSums * static_cast<int64_t>(hn::Lanes(Tag())); }

float MultiplyAddRounds(int64_t rounds, float factor) {
  const Tag tag;
  const auto by = hn::Set(tag, factor), plus = hn::Set(tag, 1 - factor);
  hn::Vec<Tag> sums[kSums];
  for (int i = 0; i < kSums; ++i) sums[i] = hn::Set(tag, static_cast<float>(i));
  for (int64_t r = 0; r < rounds; ++r) {
    for (int i = 0; i < kSums; ++i) sums[i] = hn::MulAdd(sums[i], by, plus);
  }
  for (int i = 1; i < kSums; ++i) sums[0] = hn::Add(sums[0], sums[i]);
  return hn::GetLane(hn::SumOfLanes(tag, sums[0]));
}

int64_t ThisTarget() { return HWY_TARGET; }

}  // namespace HWY_NAMESPACE
}  // namespace editnerf
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace editnerf {

HWY_EXPORT(OperationsPerRound);
HWY_EXPORT(MultiplyAddRounds);
HWY_EXPORT(ThisTarget);

std::string InstructionSet() { return hwy::TargetName(HWY_DYNAMIC_DISPATCH(ThisTarget)()); }

double MeasurePeakFlops() {
  constexpr int64_t kRounds = 2'000'000;
  constexpr int kTries = 7;
  static std::atomic<float> result{0};  // so that nothing is optimised away
  const int64_t threads = NumThreads();
  double least = 1e9;
  for (int i = 0; i < kTries; ++i) {
    const double before = ProcessorSeconds();
    ParallelFor(threads, 1, [&](int64_t begin, int64_t end) {
      for (int64_t t = begin; t < end; ++t) {
        result = result + HWY_DYNAMIC_DISPATCH(MultiplyAddRounds)(kRounds, 0.999F);
      }
    });
    least = std::min(least, ProcessorSeconds() - before);
  }
  return static_cast<double>(threads * kRounds * HWY_DYNAMIC_DISPATCH(OperationsPerRound)()) / least;
}

}  // namespace editnerf
#endif
