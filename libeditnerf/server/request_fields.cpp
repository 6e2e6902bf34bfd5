#include "libeditnerf/server/request_fields.h"

#include <stdexcept>

#include "libeditnerf/base/error.h"
#include "libeditnerf/base/json_text.h"

namespace editnerf {
namespace {

constexpr size_t kMaxPairs = 1000;

}  // namespace

Json ParseRequest(const std::string& body) {
  Json json = ParseJson(body, "request");
  if (!json.is_object()) Throw<DataError>("request: expected a JSON object, found {}", Brief(json));
  return json;
}

std::string TabName(const Json& body) {
  const auto tab = body.find("tab");
  if (tab == body.end()) return "";
  if (!tab->is_string()) Throw<DataError>("request: tab: expected a name in quotes, found {}", Brief(*tab));
  return tab->get<std::string>();
}

bool JsonFlag(const Json& object, const char* name, const std::string& where) {
  const auto flag = object.find(name);
  if (flag == object.end()) return false;
  if (!flag->is_boolean()) Throw<DataError>("{}: {}: expected true or false, found {}", where, name, Brief(*flag));
  return flag->get<bool>();
}

const Json& JsonList(const Json& body, const char* name, size_t most) {
  const Json& list = JsonField(body, name, "request");
  if (!list.is_array() || list.size() > most) {
    Throw<DataError>("request: {}: expected a list of at most {}, found {}", name, most,
                     list.is_array() ? fmt::format("one of {}", list.size()) : Brief(list));
  }
  return list;
}

std::vector<FramePair> FramePairsOf(const Json& body) {
  std::vector<FramePair> found;
  for (const Json& pair : JsonList(body, "pairs", kMaxPairs)) {
    const std::string where = fmt::format("request: pairs[{}]", found.size());
    if (!pair.is_array() || pair.size() != 2) {
      Throw<DataError>("{}: expected a frame of the video and a row, found {}", where, Brief(pair));
    }
    found.push_back({WholeNumber(pair[0], where), WholeNumber(pair[1], where)});
  }
  return found;
}

int64_t WholeNumberIn(const std::string& text, const char* name) {
  if (text.empty() || text.size() > 15 || text.find_first_not_of("0123456789") != std::string::npos) {
    Throw<DataError>("{}: expected a whole number, found '{}'", name, text.substr(0, 20));
  }
  return std::stoll(text);
}

double Fps(const std::string& text) {
  if (text.empty()) return 24;
  try {
    size_t end = 0;
    const double fps = std::stod(text, &end);
    if (end == text.size()) return fps;
  } catch (const std::logic_error&) {  // told below
  }
  Throw<DataError>("fps: expected a number, found '{}'", text.substr(0, 20));
}

}  // namespace editnerf
