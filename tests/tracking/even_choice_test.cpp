#include "libeditnerf/tracking/even_choice.h"

#include "tests/catch.h"

using namespace editnerf;

namespace {

using Chosen = std::vector<bool>;

}  // namespace

TEST_CASE("observers of what few see are kept beside those that see most") {
  // Four that see the first three things, one the fourth.
  const std::vector<std::vector<int>> tells = {{1, 1, 1, 0}, {1, 1, 0, 0}, {1, 1, 1, 0}, {0, 0, 0, 1}, {1, 1, 1, 0}};
  CHECK(EvenChoice(tells, 1) == Chosen{true, false, false, false, false});
  CHECK(EvenChoice(tells, 2) == Chosen{true, false, true, false, false});
  CHECK(EvenChoice(tells, 3) == Chosen{true, false, true, true, false});
}

TEST_CASE("all observers are kept where no more are asked for, and none of none") {
  CHECK(EvenChoice({{1, 0}, {0, 1}}, 2) == Chosen{true, true});
  CHECK(EvenChoice({{1, 0}, {0, 1}}, 5) == Chosen{true, true});
  CHECK(EvenChoice({{1, 0}, {0, 1}}, 0) == Chosen{false, false});
  CHECK(EvenChoice({}, 3).empty());
}
