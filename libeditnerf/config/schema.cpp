#include "libeditnerf/config/schema.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "libeditnerf/config/nearest.h"

namespace editnerf {
namespace {

std::string RangeText(const Bounds& bounds) {
  const bool low = std::isfinite(bounds.low), high = std::isfinite(bounds.high);
  if (low && high) return fmt::format(" between {} and {}", bounds.low, bounds.high);
  if (low) return fmt::format(bounds.low_open ? " greater than {}" : " of at least {}", bounds.low);
  if (high) return fmt::format(" of at most {}", bounds.high);
  return "";
}

// Text that YAML reads back as the same text without quotes.
bool IsPlain(const std::string& text) {
  static const char* const kReserved[] = {"null", "true", "false", "yes", "no", "on", "off"};
  const auto is_letter = [](char c) { return (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') || c == '_'; };
  if (text.empty() || !is_letter(text[0])) return false;
  const auto is_safe = [&](char c) {
    return is_letter(c) || (c >= '0' && c <= '9') || c == '-' || c == '/' || c == '.';
  };
  std::string lower = text;
  std::transform(lower.begin(), lower.end(), lower.begin(), [](unsigned char c) { return std::tolower(c); });
  return std::all_of(text.begin(), text.end(), is_safe) &&
         std::none_of(std::begin(kReserved), std::end(kReserved), [&](const char* word) { return lower == word; });
}

std::string QuotedText(const std::string& text) {
  if (IsPlain(text)) return text;
  std::string quoted = "\"";
  for (const char c : text) {
    if (c == '"' || c == '\\') {
      quoted += '\\';
      quoted += c;
    } else if (static_cast<unsigned char>(c) < 0x20 || c == 0x7f) {
      quoted += fmt::format("\\x{:02x}", static_cast<unsigned>(c));
    } else {
      quoted += c;
    }
  }
  return quoted + "\"";
}

bool InBounds(double value, const Bounds& bounds) {
  return std::isfinite(value) && value <= bounds.high && (bounds.low_open ? value > bounds.low : value >= bounds.low);
}

// Paths of all settings below `group` with this name.
void CollectPaths(const Setting& group, const std::string& name, std::vector<std::string>& paths) {
  for (const Setting& child : group.children) {
    if (child.name == name) paths.push_back(child.path);
    CollectPaths(child, name, paths);
  }
}

}  // namespace

const Setting* Setting::Child(const std::string& child_name) const {
  for (const Setting& child : children)
    if (child.name == child_name) return &child;
  return nullptr;
}

std::string Expectation(const Setting& setting) {
  if (setting.is_group()) return "a group of settings";
  if (std::holds_alternative<int64_t*>(setting.value)) return "an integer" + RangeText(setting.bounds);
  if (std::holds_alternative<double*>(setting.value)) return "a number" + RangeText(setting.bounds);
  if (std::holds_alternative<bool*>(setting.value)) return "true or false";
  if (std::holds_alternative<Choice*>(setting.value)) return "true, false or auto";
  if (setting.words.empty()) return "a text";
  return fmt::format("one of '{}'", fmt::join(setting.words, "', '"));
}

std::string ValueText(const Setting& setting) {
  if (const auto* integer = std::get_if<int64_t*>(&setting.value)) return fmt::format("{}", **integer);
  if (const auto* number = std::get_if<double*>(&setting.value)) return fmt::format("{}", **number);
  if (const auto* flag = std::get_if<bool*>(&setting.value)) return **flag ? "true" : "false";
  if (const auto* choice = std::get_if<Choice*>(&setting.value)) {
    return **choice == Choice::kAuto ? "auto" : **choice == Choice::kOn ? "true" : "false";
  }
  if (const auto* text = std::get_if<std::string*>(&setting.value)) return QuotedText(**text);
  return "";
}

bool InRange(const Setting& setting) {
  if (const auto* integer = std::get_if<int64_t*>(&setting.value)) {
    return InBounds(static_cast<double>(**integer), setting.bounds);
  }
  if (const auto* number = std::get_if<double*>(&setting.value)) return InBounds(**number, setting.bounds);
  if (const auto* text = std::get_if<std::string*>(&setting.value)) {
    return setting.words.empty() ||
           std::find(setting.words.begin(), setting.words.end(), **text) != setting.words.end();
  }
  return true;
}

std::string Suggestion(const Setting& root, const Setting& group, const std::string& name) {
  std::vector<std::string> names;
  for (const Setting& child : group.children) names.push_back(child.name);
  if (const auto nearest = NearestWord(name, names)) return fmt::format("; did you mean '{}'?", *nearest);
  std::vector<std::string> paths;
  CollectPaths(root, name, paths);
  if (!paths.empty() && paths.size() <= 3) return fmt::format("; did you mean '{}'?", fmt::join(paths, "' or '"));
  return fmt::format("; known here: {}", fmt::join(names, ", "));
}

}  // namespace editnerf
