// The word that a misspelt one was probably meant to be.
#pragma once

#include <cstddef>
#include <optional>
#include <string>
#include <vector>

namespace editnerf {

// Insertions, deletions, substitutions and swaps of neighbours that turn a into b (optimal string alignment):
// EditDistance("depth", "dpeth") = 1.
size_t EditDistance(const std::string& a, const std::string& b);

// The first of the words with the least edit distance to `text`, if that is at most a third of the longer one's length.
std::optional<std::string> NearestWord(const std::string& text, const std::vector<std::string>& words);

}  // namespace editnerf
