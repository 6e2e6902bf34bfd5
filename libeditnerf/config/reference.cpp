#include "libeditnerf/config/reference.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "libeditnerf/config/schema.h"

namespace editnerf {
namespace {

std::string TypeText(const Setting& setting) {
  if (std::holds_alternative<int64_t*>(setting.value)) return "integer";
  if (std::holds_alternative<double*>(setting.value)) return "number";
  if (std::holds_alternative<Choice*>(setting.value)) return "choice";
  return std::holds_alternative<bool*>(setting.value) ? "boolean" : "text";
}

std::string RangeText(const Setting& setting) {
  if (std::holds_alternative<bool*>(setting.value)) return "true, false";
  if (std::holds_alternative<Choice*>(setting.value)) return "true, false, auto";
  if (!setting.words.empty()) return fmt::format("{}", fmt::join(setting.words, ", "));
  const bool low = std::isfinite(setting.bounds.low), high = std::isfinite(setting.bounds.high);
  if (low && high) return fmt::format("{} to {}", setting.bounds.low, setting.bounds.high);
  if (low) return fmt::format("{} {}", setting.bounds.low_open ? ">" : ">=", setting.bounds.low);
  if (high) return fmt::format("<= {}", setting.bounds.high);
  return "any";
}

// Text between the bars of a Markdown table.
std::string Cell(const std::string& text) {
  std::string cell;
  for (const char c : text) {
    if (c == '<' || c == '|' || c == '*') cell += '\\';
    cell += c;
  }
  return cell;
}

std::string Capitalized(std::string text) {
  if (!text.empty() && text[0] >= 'a' && text[0] <= 'z') text[0] = static_cast<char>(text[0] - 'a' + 'A');
  return text;
}

void WriteGroup(const Setting& group, std::string& text) {
  text += fmt::format("\n## {}\n\n{}.\n", group.path, Capitalized(group.doc));
  const auto is_value = [](const Setting& child) { return !child.is_group(); };
  if (std::any_of(group.children.begin(), group.children.end(), is_value)) {
    text += "\n| key | type | default | values | meaning |\n|---|---|---|---|---|\n";
  }
  for (const Setting& child : group.children) {
    if (child.is_group()) continue;
    text += fmt::format("| `{}` | {} | {} | {} | {} |\n", child.path, TypeText(child), ValueText(child),
                        RangeText(child), Cell(child.doc));
  }
  for (const Setting& child : group.children)
    if (child.is_group()) WriteGroup(child, text);
}

}  // namespace

std::string ConfigReference() {
  std::string text =
      "# Configuration\n\n"
      "Generated from the structs in `libeditnerf/config/`; do not edit by hand. To write it anew:\n"
      "`enf --print-config-reference > docs/configuration.md`.\n\n"
      "A configuration file is YAML and names only what it changes: everything else keeps the default below, which is "
      "the\n"
      "paper's setting, or, with `base: NAME` at its top, what the configuration of that short name says. Programs "
      "take a\n"
      "file with `--config FILE` (or one of the short names `fast`, `fine`, `paper`, `tiny`) and single settings with\n"
      "`--set key=value`. Unknown keys, duplicate keys, wrong types and values out of range are errors that name the "
      "file\n"
      "and the line. `--print-config` shows what a program would use.\n\n"
      "Settings that must fit each other: `skip_layer` is less than `depth`, or 0; `finest_resolution` is at least\n"
      "`base_resolution`; `final_learning_rate` is at most `learning_rate`.\n";
  Config config;
  const Setting root = Describe(config);
  for (const Setting& group : root.children) WriteGroup(group, text);
  return text;
}

}  // namespace editnerf
