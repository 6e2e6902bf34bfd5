#include "libeditnerf/tracking/even_choice.h"

#include <algorithm>

namespace editnerf {

std::vector<bool> EvenChoice(const std::vector<std::vector<int>>& tells, size_t count) {
  std::vector<bool> taken(tells.size(), count >= tells.size());
  if (count >= tells.size()) return taken;
  std::vector<double> known(tells.front().size(), 1);
  for (; count > 0; --count) {
    size_t best = 0;
    double most = -1;
    for (size_t i = 0; i < tells.size(); ++i) {
      if (taken[i]) continue;
      double gain = 0;
      for (size_t j = 0; j < known.size(); ++j) gain += tells[i][j] / known[j];
      if (gain > most) most = gain, best = i;
    }
    taken[best] = true;
    for (size_t j = 0; j < known.size(); ++j) known[j] += tells[best][j];
  }
  return taken;
}

}  // namespace editnerf
