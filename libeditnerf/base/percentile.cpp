#include "libeditnerf/base/percentile.h"

#include <algorithm>
#include <cmath>

namespace editnerf {

double Percentile(std::vector<double> values, double share) {
  if (values.empty()) return 0;
  const auto at = values.begin() + std::lround(share * static_cast<double>(values.size() - 1));
  std::nth_element(values.begin(), at, values.end());
  return *at;
}

}  // namespace editnerf
