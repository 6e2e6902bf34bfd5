// A strict little check that markup is well formed: tags nest and close, attributes are quoted and not repeated, every
// '&' begins an entity. Knows HTML's void elements and doctype; enough for what this project writes.
#pragma once

#include <algorithm>
#include <cctype>
#include <set>
#include <string>
#include <vector>

namespace editnerf::testing {

// Empty where the markup is well formed, otherwise what is wrong.
inline std::string MarkupProblem(const std::string& markup) {
  static const std::set<std::string> kVoid = {"meta", "img", "br", "source", "link"};
  std::vector<std::string> open;
  const auto is_entity = [&](size_t at) {
    const size_t end = markup.find(';', at);
    return end != std::string::npos && end - at <= 8 &&
           std::all_of(markup.begin() + static_cast<std::ptrdiff_t>(at) + 1,
                       markup.begin() + static_cast<std::ptrdiff_t>(end),
                       [](char c) { return std::isalnum(static_cast<unsigned char>(c)) != 0 || c == '#'; });
  };
  for (size_t i = 0; i < markup.size(); ++i) {
    if (markup[i] == '&' && !is_entity(i)) return "a bare '&' at " + markup.substr(i, 20);
    if (markup[i] == '>') return "a bare '>' at " + markup.substr(i, 20);
    if (markup[i] != '<') continue;
    if (markup.compare(i, 9, "<!doctype") == 0 || markup.compare(i, 9, "<!DOCTYPE") == 0) {
      i = markup.find('>', i);
      continue;
    }
    const bool closes = markup.compare(i, 2, "</") == 0;
    size_t at = i + (closes ? 2 : 1);
    std::string name;
    while (at < markup.size() && (std::isalnum(static_cast<unsigned char>(markup[at])) != 0)) name += markup[at++];
    if (name.empty()) return "a tag without a name at " + markup.substr(i, 20);
    std::set<std::string> attributes;
    bool closes_itself = false;
    while (at < markup.size() && markup[at] != '>') {
      if (std::isspace(static_cast<unsigned char>(markup[at])) != 0) {
        ++at;
      } else if (markup[at] == '/') {
        closes_itself = true, ++at;
      } else {
        std::string attribute;
        while (at < markup.size() && (std::isalnum(static_cast<unsigned char>(markup[at])) != 0 || markup[at] == '-')) {
          attribute += markup[at++];
        }
        if (attribute.empty() || !attributes.insert(attribute).second) return "a bad attribute in <" + name;
        if (at < markup.size() && markup[at] == '=') {
          if (markup[at + 1] != '"') return "an attribute without quotes in <" + name;
          const size_t end = markup.find('"', at + 2);
          if (end == std::string::npos) return "a quote that never ends in <" + name;
          const std::string value = markup.substr(at + 2, end - at - 2);
          if (value.find('<') != std::string::npos) return "a bare '<' in an attribute of <" + name;
          for (size_t k = value.find('&'); k != std::string::npos; k = value.find('&', k + 1)) {
            if (!is_entity(at + 2 + k)) return "a bare '&' in an attribute of <" + name;
          }
          at = end + 1;
        }
      }
    }
    if (at >= markup.size()) return "a tag that never ends: <" + name;
    i = at;
    if (closes) {
      if (open.empty() || open.back() != name)
        return "</" + name + "> closes " + (open.empty() ? "nothing" : open.back());
      open.pop_back();
    } else if (!closes_itself && kVoid.count(name) == 0) {
      open.push_back(name);
      if (name == "style") {  // its text follows other rules
        i = markup.find("</style>", i);
        if (i == std::string::npos) return "a style that never ends";
        --i;
      }
    }
  }
  return open.empty() ? "" : "<" + open.back() + "> is never closed";
}

}  // namespace editnerf::testing
