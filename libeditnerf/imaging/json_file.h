// JSON files with guarded reading: every error names the file, the key, what was found and what was expected.
#pragma once

#include <cstdint>
#include <filesystem>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

namespace editnerf {

using Json = nlohmann::json;

constexpr uintmax_t kMaxJsonBytes = uintmax_t{1} << 28;

// Throws DataError where the file is missing, larger than max_bytes, or what ParseJson refuses. Python's NaN and
// Infinity are not JSON and are refused.
Json ReadJson(const std::filesystem::path& path, uintmax_t max_bytes = kMaxJsonBytes);

// The value as a message shows it: its first 40 characters.
std::string Brief(const Json& value);

// Indented, atomic, doubles with as many digits as reading them back exactly needs.
void WriteJson(const std::filesystem::path& path, const Json& json);

// Fields of an object. `where` starts the message, usually the file's path. All throw DataError; numbers must be
// finite.
const Json& JsonField(const Json& object, const std::string& key, const std::string& where);
double JsonNumber(const Json& object, const std::string& key, const std::string& where);
int64_t JsonInteger(const Json& object, const std::string& key, const std::string& where);
std::vector<double> JsonNumbers(const Json& object, const std::string& key, size_t count, const std::string& where);
std::vector<std::string> JsonStrings(const Json& object, const std::string& key, const std::string& where);

// A matrix given as `rows` arrays of `columns` numbers; row-major.
std::vector<double> JsonMatrix(const Json& matrix, size_t rows, size_t columns, const std::string& where);

}  // namespace editnerf
