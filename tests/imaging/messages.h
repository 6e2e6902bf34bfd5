// Looking at the text of errors.
#pragma once

#include <string>

#include "tests/catch.h"

namespace editnerf {

// The message of the E that `action` throws; "no error" where it throws nothing.
template <class E, class Action>
std::string MessageOf(const Action& action) {
  try {
    action();
  } catch (const E& error) {
    return error.what();
  }
  return "no error";
}

// Matchers that Catch2 v2 and v3 name differently.
inline auto HasText(const std::string& text) {
#if __has_include(<catch2/catch_all.hpp>)
  return Catch::Matchers::ContainsSubstring(text);
#else
  return Catch::Matchers::Contains(text);
#endif
}
inline auto StartsWithText(const std::string& text) { return Catch::Matchers::StartsWith(text); }

}  // namespace editnerf
