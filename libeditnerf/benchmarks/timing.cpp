#include "libeditnerf/benchmarks/timing.h"

#include <algorithm>
#include <cmath>

#include "libeditnerf/base/clock.h"
#include "libeditnerf/base/error.h"
#include "libeditnerf/base/interrupt.h"
#include "libeditnerf/base/machine.h"

namespace editnerf {
namespace {

CallCosts CostsOf(const std::function<void()>& body, int64_t calls) {
  const double before = ProcessorSeconds();
  const Stopwatch watch;
  for (int64_t i = 0; i < calls; ++i) body();
  const auto count = static_cast<double>(calls);
  return {watch.Seconds() / count, (ProcessorSeconds() - before) / count};
}

int64_t CallsFor(const std::function<void()>& body, double least_seconds) {
  body();
  const double once = std::max(CostsOf(body, 1).seconds, 1e-9);
  return std::clamp<int64_t>(static_cast<int64_t>(std::ceil(least_seconds / once)), 1, 1'000'000);
}

CallCosts MedianOf(const std::vector<CallCosts>& all) {
  std::vector<double> seconds, processor;
  for (const CallCosts& costs : all) {
    seconds.push_back(costs.seconds);
    processor.push_back(costs.processor);
  }
  return {Median(seconds), Median(processor)};
}

}  // namespace

double Median(std::vector<double> values) {
  const auto middle = values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2);
  std::nth_element(values.begin(), middle, values.end());
  if (values.size() % 2 == 1) return *middle;
  return (*middle + *std::max_element(values.begin(), middle)) / 2;
}

PairTiming TimePair(const std::function<void()>& body, const std::function<void()>& reference, int64_t repeats,
                    double least_seconds) {
  const int64_t calls = CallsFor(body, least_seconds), reference_calls = CallsFor(reference, least_seconds);
  std::vector<CallCosts> costs, reference_costs;
  std::vector<double> ratios;
  for (int64_t i = 0; i < repeats; ++i) {
    if (InterruptRequested()) Throw<Interrupted>("benchmark stopped by request");
    costs.push_back(CostsOf(body, calls));
    reference_costs.push_back(CostsOf(reference, reference_calls));
    ratios.push_back(reference_costs.back().processor / costs.back().processor);
  }
  return {MedianOf(costs), MedianOf(reference_costs), Median(ratios)};
}

}  // namespace editnerf
