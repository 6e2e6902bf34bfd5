#include "libeditnerf/config/yaml.h"

#include <fmt/format.h>
#include <yaml-cpp/eventhandler.h>
#include <yaml-cpp/yaml.h>

#include <charconv>
#include <cmath>
#include <functional>
#include <map>
#include <sstream>

#include "libeditnerf/base/error.h"
#include "libeditnerf/base/file.h"
#include "libeditnerf/config/nearest.h"
#include "libeditnerf/config/schema.h"
#include "libeditnerf/config/validate.h"

namespace editnerf {
namespace {

constexpr uintmax_t kMaxBytes = 1 << 20;
constexpr int kMaxNodes = 10000;
constexpr int kMaxDepth = 32;

// Where a message points: a file and its line (yaml-cpp counts from 0), or a fixed text for overrides.
using Place = std::function<std::string(const YAML::Mark&)>;

Place InFile(const std::string& name) {
  return [name](const YAML::Mark& mark) { return mark.is_null() ? name : fmt::format("{}:{}", name, mark.line + 1); };
}

// Looks at the parser's events before a tree is built from them.
class LimitChecker : public YAML::EventHandler {
 public:
  explicit LimitChecker(const Place& place) : place_(place) {}

  void OnDocumentStart(const YAML::Mark&) override {}
  void OnDocumentEnd() override {}
  void OnNull(const YAML::Mark& mark, YAML::anchor_t) override { Count(mark); }
  void OnAlias(const YAML::Mark& mark, YAML::anchor_t) override { Count(mark); }
  void OnScalar(const YAML::Mark& mark, const std::string&, YAML::anchor_t, const std::string&) override {
    Count(mark);
  }
  void OnSequenceStart(const YAML::Mark& mark, const std::string&, YAML::anchor_t, YAML::EmitterStyle::value) override {
    Enter(mark);
  }
  void OnSequenceEnd() override { --depth_; }
  void OnMapStart(const YAML::Mark& mark, const std::string&, YAML::anchor_t, YAML::EmitterStyle::value) override {
    Enter(mark);
  }
  void OnMapEnd() override { --depth_; }

 private:
  void Count(const YAML::Mark& mark) {
    if (++nodes_ > kMaxNodes) Throw<ConfigError>("{}: more than {} values", place_(mark), kMaxNodes);
  }
  void Enter(const YAML::Mark& mark) {
    Count(mark);
    if (++depth_ > kMaxDepth) Throw<ConfigError>("{}: nested deeper than {} levels", place_(mark), kMaxDepth);
  }

  const Place& place_;
  int nodes_ = 0;
  int depth_ = 0;
};

YAML::Node Parse(const std::string& text, const Place& place) {
  try {
    std::istringstream stream(text);
    YAML::Parser parser(stream);
    LimitChecker checker(place);
    if (parser.HandleNextDocument(checker) && parser.HandleNextDocument(checker)) {
      Throw<ConfigError>("{}: expected one YAML document, found several", place(YAML::Mark::null_mark()));
    }
    return YAML::Load(text);
  } catch (const YAML::Exception& error) {
    Throw<ConfigError>("{}: not valid YAML: {}", place(error.mark), error.msg);
  }
}

std::string FoundText(const YAML::Node& node) {
  if (node.IsMap()) return "a mapping";
  if (node.IsSequence()) return "a list";
  if (node.IsNull()) return "nothing";
  constexpr size_t kShown = 60;
  const std::string text = node.Scalar().size() <= kShown ? node.Scalar() : node.Scalar().substr(0, kShown) + "...";
  return node.Tag() == "!" ? fmt::format("'\"{}\"'", text) : fmt::format("'{}'", text);
}

template <class Number>
bool ParseNumber(const std::string& text, Number& value) {
  const char* begin = text.data();
  const char* const end = begin + text.size();
  if (end - begin > 1 && *begin == '+' && begin[1] != '-') ++begin;
  const auto [stop, error] = std::from_chars(begin, end, value);
  return error == std::errc() && stop == end;
}

class SettingsReader {
 public:
  SettingsReader(const Setting& root, const Place& place) : root_(root), place_(place) {}

  void Read(const YAML::Node& node, const Setting& setting) {
    if (setting.is_group()) {
      ReadGroup(node, setting);
    } else {
      ReadValue(node, setting);
    }
  }

  // The place where a setting was given; the file alone where it was not.
  std::string PlaceOf(const std::string& path) const {
    const auto mark = marks_.find(path);
    return place_(mark == marks_.end() ? YAML::Mark::null_mark() : mark->second);
  }

 private:
  void ReadGroup(const YAML::Node& node, const Setting& group) {
    if (node.IsNull()) return;  // every line of the group is commented out
    const std::string subject = group.path.empty() ? "" : fmt::format("'{}': ", group.path);
    if (!node.IsMap()) {
      Throw<ConfigError>("{}: {}expected {}, found {}", place_(node.Mark()), subject, Expectation(group),
                         FoundText(node));
    }
    std::map<std::string, int> given;  // name -> line
    for (const auto& entry : node) {
      const YAML::Mark mark = entry.first.Mark();
      if (!entry.first.IsScalar()) {
        Throw<ConfigError>("{}: {}expected a name, found {}", place_(mark), subject, FoundText(entry.first));
      }
      const std::string& name = entry.first.Scalar();
      const std::string path = group.path.empty() ? name : group.path + "." + name;
      const Setting* setting = group.Child(name);
      if (setting == nullptr) {
        Throw<ConfigError>("{}: unknown key '{}'{}", place_(mark), path, Suggestion(root_, group, name));
      }
      const auto [first, is_new] = given.emplace(name, mark.line + 1);
      if (!is_new) {
        Throw<ConfigError>("{}: duplicate key '{}', first given in line {}", place_(mark), path, first->second);
      }
      marks_[path] = mark;
      Read(entry.second, *setting);
    }
  }

  void ReadValue(const YAML::Node& node, const Setting& setting) {
    if (!node.IsScalar() || !Assign(node.Scalar(), node.Tag() == "!", setting)) {
      const auto nearest = node.IsScalar() ? NearestWord(node.Scalar(), setting.words) : std::nullopt;
      Throw<ConfigError>("{}: '{}': expected {}, found {}{}", place_(node.Mark()), setting.path, Expectation(setting),
                         FoundText(node), nearest ? fmt::format("; did you mean '{}'?", *nearest) : "");
    }
  }

  static bool Assign(const std::string& text, bool quoted, const Setting& setting) {
    if (const auto* word = std::get_if<std::string*>(&setting.value)) {
      **word = text;
    } else if (quoted) {
      return false;
    } else if (const auto* flag = std::get_if<bool*>(&setting.value)) {
      if (text != "true" && text != "false") return false;
      **flag = text == "true";
    } else if (const auto* choice = std::get_if<Choice*>(&setting.value)) {
      if (text != "true" && text != "false" && text != "auto") return false;
      **choice = text == "auto" ? Choice::kAuto : text == "true" ? Choice::kOn : Choice::kOff;
    } else if (const auto* integer = std::get_if<int64_t*>(&setting.value)) {
      if (!ParseNumber(text, **integer)) return false;
    } else if (const auto* number = std::get_if<double*>(&setting.value)) {
      if (!ParseNumber(text, **number)) return false;
    }
    return InRange(setting);
  }

  const Setting& root_;
  const Place& place_;
  std::map<std::string, YAML::Mark> marks_;
};

// Takes `base` out of a file, and returns what it means.
Config TakeBase(YAML::Node* node, const Place& place, const ConfigByName& by_name) {
  if (!node->IsMap() || !(*node)["base"]) return {};
  const YAML::Node base = (*node)["base"];
  if (!base.IsScalar()) {
    Throw<ConfigError>("{}: 'base': expected the name of a configuration, found {}", place(base.Mark()),
                       FoundText(base));
  }
  const std::string name = base.Scalar();
  const YAML::Mark mark = base.Mark();
  node->remove("base");
  try {
    return by_name(name);
  } catch (const ConfigError& error) {
    Throw<ConfigError>("{}: 'base': {}", place(mark), error.what());
  }
}

void Write(const Setting& group, int indent, std::string& text) {
  for (const Setting& child : group.children) {
    text += std::string(static_cast<size_t>(indent), ' ') + child.name + ":";
    text += child.is_group() ? "\n" : " " + ValueText(child) + "\n";
    Write(child, indent + 2, text);
  }
}

}  // namespace

Config LoadConfigText(const std::string& text, const std::string& name, const ConfigByName& by_name) {
  const Place place = InFile(name);
  if (text.size() > kMaxBytes) Throw<ConfigError>("{}: {} bytes, expected at most {}", name, text.size(), kMaxBytes);
  YAML::Node node = Parse(text, place);
  Config config = by_name ? TakeBase(&node, place, by_name) : Config();
  const Setting root = Describe(config);
  SettingsReader reader(root, place);
  reader.Read(node, root);
  if (const auto violation = FindViolation(config)) {
    Throw<ConfigError>("{}: {}", reader.PlaceOf(violation->path), violation->message);
  }
  return config;
}

Config LoadConfig(const std::filesystem::path& path, const ConfigByName& by_name) {
  std::string text;
  try {
    text = ReadFile(path, kMaxBytes);
  } catch (const DataError& error) {
    throw ConfigError(error.what());
  }
  return LoadConfigText(text, path.string(), by_name);
}

void ApplyOverride(Config& config, const std::string& assignment, const std::string& where) {
  const std::string here = where + " " + assignment;
  const size_t equals = assignment.find('=');
  if (equals == std::string::npos || equals == 0) {
    Throw<ConfigError>("{}: expected KEY=VALUE, for example train.steps=100", here);
  }
  const std::string path = assignment.substr(0, equals);
  Config changed = config;
  const Setting root = Describe(changed);
  const Setting* setting = &root;
  for (size_t begin = 0; begin <= path.size();) {
    const size_t end = std::min(path.find('.', begin), path.size());
    const std::string name = path.substr(begin, end - begin);
    const Setting* child = setting->Child(name);
    if (child == nullptr) {
      Throw<ConfigError>("{}: unknown key '{}'{}", here, path.substr(0, end),
                         setting->is_group() ? Suggestion(root, *setting, name)
                                             : fmt::format("; '{}' is {}", setting->path, Expectation(*setting)));
    }
    setting = child;
    begin = end + 1;
  }
  const Place place = [&here](const YAML::Mark&) { return std::string(here); };
  SettingsReader(root, place).Read(Parse(assignment.substr(equals + 1), place), *setting);
  config = changed;
}

std::string ToYaml(const Config& config) {
  Config copy = config;  // a description points into a mutable struct
  std::string text;
  Write(Describe(copy), 0, text);
  return text;
}

}  // namespace editnerf
