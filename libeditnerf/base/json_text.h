// JSON text from outside, with the checks that the JSON library leaves out: it nests without limit, so that whoever
// walks the result by recursion (also the library's own dump) runs out of stack, and of two equal names it silently
// keeps the last.
#pragma once

#include <cstdint>
#include <nlohmann/json_fwd.hpp>
#include <string>

namespace editnerf {

constexpr int kMaxJsonDepth = 64;  // the deepest file of this library has 6 levels

// Throws DataError, beginning with "where: ", at text that is not JSON (with line and column), at one that nests deeper
// than kMaxJsonDepth, and at a name that an object has twice.
nlohmann::json ParseJson(const std::string& text, const std::string& where);

// Throws DataError, beginning with "where: ", unless the value is an integer that int64 holds. The library's own
// conversion takes true for 1, and what it makes of 1e300 is undefined.
int64_t WholeNumber(const nlohmann::json& value, const std::string& where);

}  // namespace editnerf
