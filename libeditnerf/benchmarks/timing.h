// How times are taken: medians over repeats, and of two things to compare by turns, so that other load on the machine
// meets both.
#pragma once

#include <cstdint>
#include <functional>
#include <vector>

namespace editnerf {

double Median(std::vector<double> values);  // values: not empty

struct CallCosts {
  double seconds = 0, processor = 0;  // of one call: by the clock, and of all threads together
};

struct PairTiming {
  CallCosts body, reference;  // medians
  double ratio = 0;           // median of the reference's processor time over the body's, pair by pair
};

// Calls each once to warm up, and then by turns `repeats` times, each time as often as fills `least_seconds`.
PairTiming TimePair(const std::function<void()>& body, const std::function<void()>& reference, int64_t repeats,
                    double least_seconds);

}  // namespace editnerf
