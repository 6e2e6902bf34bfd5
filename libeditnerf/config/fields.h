// How configuration structs describe themselves. A struct lists its fields once, in a member template
//   template <class Visitor> void Visit(Visitor& v) { v("depth", depth, "hidden layers", AtLeast(1)); ... }
// and the YAML reader and writer, the validator and the generated reference all visit that list.
#pragma once

#include <limits>
#include <string>
#include <vector>

namespace editnerf {

// What values a number may take, inclusive unless `low_open`.
struct Bounds {
  double low = -std::numeric_limits<double>::infinity();
  double high = std::numeric_limits<double>::infinity();
  bool low_open = false;
};
inline Bounds AnyNumber() { return {}; }
inline Bounds AtLeast(double low) { return {low, std::numeric_limits<double>::infinity(), false}; }
inline Bounds Positive() { return {0, std::numeric_limits<double>::infinity(), true}; }
inline Bounds Between(double low, double high) { return {low, high, false}; }

// A component of the field that is there, is not, or is decided by what it brings on held-out pixels
// (pipeline/component_trials.h).
enum class Choice { kOff, kOn, kAuto };

// The words that a text field may hold.
struct OneOf {
  std::vector<std::string> words;
};

}  // namespace editnerf
