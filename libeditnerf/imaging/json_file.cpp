#include "libeditnerf/imaging/json_file.h"

#include <cmath>

#include "libeditnerf/base/error.h"
#include "libeditnerf/base/file.h"
#include "libeditnerf/base/json_text.h"

namespace editnerf {
namespace {

double FiniteNumber(const Json& value, const std::string& key, const std::string& where) {
  if (!value.is_number()) Throw<DataError>("{}: {}: expected a number, found {}", where, key, Brief(value));
  const double number = value.get<double>();
  if (!std::isfinite(number)) Throw<DataError>("{}: {}: expected a finite number, found {}", where, key, number);
  return number;
}

}  // namespace

std::string Brief(const Json& value) {
  const std::string text = value.dump(-1, ' ', false, Json::error_handler_t::replace);
  return text.size() <= 40 ? text : text.substr(0, 37) + "...";
}

Json ReadJson(const std::filesystem::path& path, uintmax_t max_bytes) {
  return ParseJson(ReadFile(path, max_bytes), path.string());
}

void WriteJson(const std::filesystem::path& path, const Json& json) {
  WriteFileAtomically(path, json.dump(1, ' ', false, Json::error_handler_t::replace) + "\n");
}

const Json& JsonField(const Json& object, const std::string& key, const std::string& where) {
  if (!object.is_object()) Throw<DataError>("{}: expected an object with '{}', found {}", where, key, Brief(object));
  const auto field = object.find(key);
  if (field == object.end()) Throw<DataError>("{}: '{}' is missing", where, key);
  return *field;
}

double JsonNumber(const Json& object, const std::string& key, const std::string& where) {
  return FiniteNumber(JsonField(object, key, where), key, where);
}

int64_t JsonInteger(const Json& object, const std::string& key, const std::string& where) {
  const double number = JsonNumber(object, key, where);
  if (number != std::floor(number) || std::abs(number) > 1e15) {
    Throw<DataError>("{}: {}: expected a whole number, found {}", where, key, number);
  }
  return static_cast<int64_t>(number);
}

std::vector<double> JsonNumbers(const Json& object, const std::string& key, size_t count, const std::string& where) {
  const Json& field = JsonField(object, key, where);
  if (!field.is_array() || field.size() != count) {
    Throw<DataError>("{}: {}: expected {} numbers, found {}", where, key, count, Brief(field));
  }
  std::vector<double> numbers;
  for (const Json& value : field) numbers.push_back(FiniteNumber(value, key, where));
  return numbers;
}

std::vector<std::string> JsonStrings(const Json& object, const std::string& key, const std::string& where) {
  const Json& field = JsonField(object, key, where);
  if (!field.is_array()) Throw<DataError>("{}: {}: expected a list of names, found {}", where, key, Brief(field));
  std::vector<std::string> strings;
  for (const Json& value : field) {
    if (!value.is_string()) Throw<DataError>("{}: {}: expected names in quotes, found {}", where, key, Brief(value));
    strings.push_back(value.get<std::string>());
  }
  return strings;
}

std::vector<double> JsonMatrix(const Json& matrix, size_t rows, size_t columns, const std::string& where) {
  if (!matrix.is_array() || matrix.size() != rows) {
    Throw<DataError>("{}: expected a {} x {} matrix, found {}", where, rows, columns, Brief(matrix));
  }
  std::vector<double> values;
  for (const Json& row : matrix) {
    if (!row.is_array() || row.size() != columns) {
      Throw<DataError>("{}: expected a {} x {} matrix with rows of {} numbers, found {}", where, rows, columns, columns,
                       Brief(row));
    }
    for (const Json& value : row) values.push_back(FiniteNumber(value, "matrix", where));
  }
  return values;
}

}  // namespace editnerf
