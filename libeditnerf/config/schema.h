// The settings of a configuration as a tree, built from the structs' Visit members: what the reader, the writer, the
// validator and the generated reference walk.
#pragma once

#include <cstdint>
#include <string>
#include <utility>
#include <variant>
#include <vector>

#include "libeditnerf/config/config.h"
#include "libeditnerf/config/fields.h"

namespace editnerf {

// One setting, or a group of them. `value` points into the struct that was described, which must outlive the tree.
struct Setting {
  std::string name;  // "depth"
  std::string path;  // "field.warp.depth"; empty for the root
  std::string doc;
  std::variant<std::monostate, int64_t*, double*, bool*, Choice*, std::string*> value;  // monostate: a group
  Bounds bounds;
  std::vector<std::string> words;  // a text's choices; empty: any text
  std::vector<Setting> children;

  bool is_group() const { return value.index() == 0; }
  const Setting* Child(const std::string& child_name) const;  // nullptr if there is none
};

// Collects what a Visit member lists.
class SchemaBuilder {
 public:
  explicit SchemaBuilder(Setting& parent) : parent_(parent) {}

  void operator()(const char* name, bool& field, const char* doc) { Add(name, doc).value = &field; }
  void operator()(const char* name, Choice& field, const char* doc) { Add(name, doc).value = &field; }
  void operator()(const char* name, std::string& field, const char* doc) { Add(name, doc).value = &field; }
  void operator()(const char* name, std::string& field, const char* doc, OneOf choices) {
    Setting& setting = Add(name, doc);
    setting.value = &field;
    setting.words = std::move(choices.words);
  }
  void operator()(const char* name, int64_t& field, const char* doc, Bounds bounds = {}) {
    Setting& setting = Add(name, doc);
    setting.value = &field;
    setting.bounds = bounds;
  }
  void operator()(const char* name, double& field, const char* doc, Bounds bounds = {}) {
    Setting& setting = Add(name, doc);
    setting.value = &field;
    setting.bounds = bounds;
  }
  template <class Group>
  void operator()(const char* name, Group& group, const char* doc) {
    Setting& setting = Add(name, doc);
    SchemaBuilder builder(setting);
    group.Visit(builder);
  }

 private:
  Setting& Add(const char* name, const char* doc) {
    Setting setting;
    setting.name = name;
    setting.path = parent_.path.empty() ? name : parent_.path + "." + name;
    setting.doc = doc;
    parent_.children.push_back(std::move(setting));
    return parent_.children.back();
  }

  Setting& parent_;
};

// Any struct with a Visit member; most callers describe a Config.
template <class Group>
Setting Describe(Group& group) {
  Setting root;
  SchemaBuilder builder(root);
  group.Visit(builder);
  return root;
}

// "an integer between 1 and 32", "a number greater than 0", "true or false", "true, false or auto", "one of 'auto',
// 'odd', 'none'".
std::string Expectation(const Setting& setting);

// The value as YAML writes it; numbers read back exactly.
std::string ValueText(const Setting& setting);

// Whether the setting's present value satisfies its bounds or choices. True for groups.
bool InRange(const Setting& setting);

// "; did you mean 'depth'?", or the known names, or where else in `root` that name exists. `group` is where it was
// found.
std::string Suggestion(const Setting& root, const Setting& group, const std::string& name);

}  // namespace editnerf
