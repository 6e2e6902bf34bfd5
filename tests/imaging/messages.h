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

inline auto StartsWithText(const std::string& text) { return Catch::Matchers::StartsWith(text); }

}  // namespace editnerf
