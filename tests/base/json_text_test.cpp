#include "libeditnerf/base/json_text.h"

#include <nlohmann/json.hpp>

#include "libeditnerf/base/error.h"
#include "tests/catch.h"

using namespace editnerf;

namespace {

std::string Nested(size_t levels) { return std::string(levels, '[') + std::string(levels, ']'); }

}  // namespace

TEST_CASE("JSON is read as it stands") {
  CHECK(ParseJson(R"({"a": [1, {"a": null}], "b": {"a": 2.5}})", "x")["b"]["a"] == 2.5);
  CHECK(ParseJson(Nested(kMaxJsonDepth), "x").is_array());
}

TEST_CASE("JSON that nests deeper than any file is refused before anybody walks it") {
  for (const size_t levels : {size_t{kMaxJsonDepth} + 2, size_t{200000}}) {
    CHECK_THROWS_WITH(ParseJson(Nested(levels), "a.json"), "a.json: nested deeper than 64 levels");
  }
}

TEST_CASE("a name that an object has twice is refused") {
  CHECK_THROWS_WITH(ParseJson(R"({"a": {"b": 1}, "c": {"b": 2, "b": 3}})", "a.json"), "a.json: 'b' is given twice");
}

TEST_CASE("text that is not JSON is refused with line and column") {
  CHECK_THROWS_WITH(ParseJson("{\"a\":\n  nan}", "a.json"), HasText("a.json: expected JSON: parse error at line 2"));
  CHECK_THROWS_WITH(ParseJson("[1e999]", "a.json"), HasText("a.json: expected JSON: number overflow"));
  CHECK_THROWS_AS(ParseJson("", "a.json"), DataError);
}

TEST_CASE("whole numbers are integers that int64 holds, and nothing that becomes one") {
  CHECK(WholeNumber(nlohmann::json(-7), "x") == -7);
  CHECK(WholeNumber(nlohmann::json(uint64_t{7}), "x") == 7);
  CHECK_THROWS_WITH(WholeNumber(nlohmann::json(1e300), "x"), "x: expected a whole number, found 1e+300");
  CHECK_THROWS_AS(WholeNumber(nlohmann::json(true), "x"), DataError);
  CHECK_THROWS_AS(WholeNumber(nlohmann::json(UINT64_MAX), "x"), DataError);
}
