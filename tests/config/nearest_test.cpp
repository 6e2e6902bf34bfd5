#include "libeditnerf/config/nearest.h"

#include "tests/catch.h"

namespace editnerf {

TEST_CASE("edit distance counts insertions, deletions, substitutions and swaps") {
  CHECK(EditDistance("", "") == 0);
  CHECK(EditDistance("abc", "") == 3);
  CHECK(EditDistance("depth", "dpeth") == 1);
  CHECK(EditDistance("kitten", "sitting") == 3);
  CHECK(EditDistance("num_octave", "num_octaves") == 1);
}

TEST_CASE("the nearest word is given only when it is near") {
  CHECK(NearestWord("widht", {"depth", "width"}) == std::optional<std::string>("width"));
  CHECK_FALSE(NearestWord("colour", {"depth", "width"}).has_value());
  CHECK_FALSE(NearestWord("x", {}).has_value());
  CHECK_FALSE(NearestWord(std::string(100000, 'x'), {std::string(100000, 'x')}).has_value());
}

}  // namespace editnerf
