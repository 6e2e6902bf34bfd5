// Order statistics of a few numbers.
#pragma once

#include <vector>

namespace editnerf {

// The value of rank round(share (n - 1)); 0 without any. share in [0, 1].
double Percentile(std::vector<double> values, double share);

}  // namespace editnerf
