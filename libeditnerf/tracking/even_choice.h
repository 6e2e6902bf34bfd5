// Which few of many observers to keep, so that everything is known about as well.
#pragma once

#include <cstddef>
#include <vector>

namespace editnerf {

// tells[i][j]: how often observer i sees j, all rows of one length. One observer after the other is taken that tells
// most of what is known least: seeing j once more is worth the less, the more often those taken see it. Returns for
// each observer whether it is among the `count` taken; all are where there are no more.
std::vector<bool> EvenChoice(const std::vector<std::vector<int>>& tells, size_t count);

}  // namespace editnerf
