#include "libeditnerf/config/nearest.h"

#include <algorithm>

namespace editnerf {

size_t EditDistance(const std::string& a, const std::string& b) {
  std::vector<std::vector<size_t>> cost(a.size() + 1, std::vector<size_t>(b.size() + 1));
  for (size_t i = 0; i <= a.size(); ++i) cost[i][0] = i;
  for (size_t j = 0; j <= b.size(); ++j) cost[0][j] = j;
  for (size_t i = 1; i <= a.size(); ++i) {
    for (size_t j = 1; j <= b.size(); ++j) {
      const size_t substitution = cost[i - 1][j - 1] + (a[i - 1] == b[j - 1] ? 0 : 1);
      cost[i][j] = std::min({cost[i - 1][j] + 1, cost[i][j - 1] + 1, substitution});
      if (i > 1 && j > 1 && a[i - 1] == b[j - 2] && a[i - 2] == b[j - 1]) {
        cost[i][j] = std::min(cost[i][j], cost[i - 2][j - 2] + 1);
      }
    }
  }
  return cost[a.size()][b.size()];
}

std::optional<std::string> NearestWord(const std::string& text, const std::vector<std::string>& words) {
  constexpr size_t kLongest = 64;  // no name is longer; keeps a hostile key cheap
  if (text.size() > kLongest) return std::nullopt;
  std::optional<std::string> nearest;
  size_t least = 0;
  for (const std::string& word : words) {
    const size_t distance = EditDistance(text, word);
    if (3 * distance > std::max(text.size(), word.size())) continue;
    if (!nearest || distance < least) {
      nearest = word;
      least = distance;
    }
  }
  return nearest;
}

}  // namespace editnerf
