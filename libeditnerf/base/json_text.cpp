#include "libeditnerf/base/json_text.h"

#include <nlohmann/json.hpp>
#include <set>
#include <vector>

#include "libeditnerf/base/error.h"

namespace editnerf {

nlohmann::json ParseJson(const std::string& text, const std::string& where) {
  using Event = nlohmann::json::parse_event_t;
  std::vector<std::set<std::string>> names;  // of the objects that are open
  const auto check = [&](int depth, Event event, nlohmann::json& parsed) {
    if (depth > kMaxJsonDepth) Throw<DataError>("{}: nested deeper than {} levels", where, kMaxJsonDepth);
    if (event == Event::object_start) names.emplace_back();
    if (event == Event::object_end) names.pop_back();
    if (event == Event::key && !names.back().insert(parsed.get<std::string>()).second) {
      Throw<DataError>("{}: '{}' is given twice", where, parsed.get<std::string>());
    }
    return true;
  };
  try {
    return nlohmann::json::parse(text, check);
  } catch (const nlohmann::json::exception& error) {
    std::string reason = error.what();
    const size_t end_of_tag = reason.find("] ");  // "[json.exception.parse_error.101] parse error at line 1, ..."
    if (end_of_tag != std::string::npos) reason = reason.substr(end_of_tag + 2);
    Throw<DataError>("{}: expected JSON: {}", where, reason);
  }
}

int64_t WholeNumber(const nlohmann::json& value, const std::string& where) {
  if (!value.is_number_integer() || (value.is_number_unsigned() && value.get<uint64_t>() > INT64_MAX)) {
    Throw<DataError>("{}: expected a whole number, found {}", where, value.dump().substr(0, 40));
  }
  return value.get<int64_t>();
}

}  // namespace editnerf
