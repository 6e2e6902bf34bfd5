#include "libeditnerf/base/safetensors.h"

#include <torch/types.h>

#include <algorithm>
#include <cerrno>
#include <cstring>
#include <fstream>
#include <nlohmann/json.hpp>
#include <vector>

#include "libeditnerf/base/error.h"
#include "libeditnerf/base/file.h"
#include "libeditnerf/base/json_text.h"

namespace editnerf {
namespace {

using Json = nlohmann::json;

constexpr const char* kMetadataName = "__metadata__";
constexpr uint64_t kMaxHeaderBytes = 100'000'000;  // the format's own limit
constexpr size_t kMaxDims = 32;

struct DtypeName {
  const char* name;
  torch::ScalarType type;
};
constexpr DtypeName kDtypes[] = {{"F64", torch::kFloat64},   {"F32", torch::kFloat32}, {"F16", torch::kFloat16},
                                 {"BF16", torch::kBFloat16}, {"I64", torch::kInt64},   {"I32", torch::kInt32},
                                 {"I16", torch::kInt16},     {"I8", torch::kInt8},     {"U8", torch::kUInt8},
                                 {"BOOL", torch::kBool}};

const char* NameOf(torch::ScalarType type) {
  for (const DtypeName& dtype : kDtypes)
    if (dtype.type == type) return dtype.name;
  return nullptr;
}

const DtypeName* Find(const std::string& name) {
  for (const DtypeName& dtype : kDtypes)
    if (name == dtype.name) return &dtype;
  return nullptr;
}

// A tensor of the header, checked.
struct Entry {
  std::string name;
  torch::ScalarType type;
  std::vector<int64_t> shape;
  uint64_t begin = 0, end = 0;  // from the header's end
};

struct Header {
  std::map<std::string, std::string> metadata;
  std::vector<Entry> entries;  // in the order of their bytes
};

class HeaderReader {
 public:
  HeaderReader(std::string path, std::ifstream& stream) : path_(std::move(path)), stream_(stream) {}

  // Leaves the stream at the first tensor's bytes.
  Header Read() {
    std::error_code code;
    const uint64_t file_bytes = std::filesystem::file_size(path_, code);
    if (code) Fail("{}", code.message());
    if (file_bytes < 8) Fail("{} bytes, expected a safetensors file, which has at least 8", file_bytes);
    uint64_t header_bytes = 0;
    stream_.read(reinterpret_cast<char*>(&header_bytes), 8);
    if (header_bytes > kMaxHeaderBytes || header_bytes > file_bytes - 8) {
      Fail("its header claims {} bytes, but {} follow; the file is truncated or not a safetensors file", header_bytes,
           file_bytes - 8);
    }
    std::string text(header_bytes, '\0');
    if (!stream_.read(text.data(), static_cast<std::streamsize>(header_bytes))) Fail("cannot be read");
    const Json json = ParseHeader(text);
    Header header;
    for (const auto& [name, value] : json.items()) {
      if (name == kMetadataName) {
        header.metadata = ReadMetadata(value);
      } else {
        header.entries.push_back(ReadEntry(name, value));
      }
    }
    CheckOffsets(header.entries, file_bytes - 8 - header_bytes);
    return header;
  }

  template <class... Args>
  [[noreturn]] void Fail(fmt::format_string<Args...> format, Args&&... args) const {
    throw CheckpointError(path_ + ": " + fmt::format(format, std::forward<Args>(args)...));
  }

 private:
  Json ParseHeader(const std::string& text) const {
    try {
      Json json = ParseJson(text, path_ + ": its header");
      if (!json.is_object()) Fail("its header is not a JSON object");
      return json;
    } catch (const DataError& error) {
      throw CheckpointError(error.what());
    }
  }

  std::map<std::string, std::string> ReadMetadata(const Json& json) const {
    std::map<std::string, std::string> metadata;
    if (!json.is_object()) Fail("expected an object in __metadata__");
    for (const auto& [key, value] : json.items()) {
      if (!value.is_string()) Fail("expected a text in __metadata__ '{}'", key);
      metadata[key] = value.get<std::string>();
    }
    return metadata;
  }

  // The number of bytes may not overflow, even where a zero in the shape hides it.
  Entry ReadEntry(const std::string& name, const Json& json) const {
    const auto is_list_of_counts = [](const Json& list) {
      return list.is_array() &&
             std::all_of(list.begin(), list.end(), [](const Json& v) { return v.is_number_unsigned(); });
    };
    if (!json.is_object() || !json.contains("dtype") || !json["dtype"].is_string() || !json.contains("shape") ||
        !is_list_of_counts(json["shape"]) || !json.contains("data_offsets") ||
        !is_list_of_counts(json["data_offsets"]) || json["data_offsets"].size() != 2) {
      Fail("tensor '{}': expected a dtype, a shape and two data_offsets", name);
    }
    const DtypeName* dtype = Find(json["dtype"].get<std::string>());
    if (dtype == nullptr) Fail("tensor '{}': unknown dtype '{}'", name, json["dtype"].get<std::string>());
    Entry entry{
        name, dtype->type, {}, json["data_offsets"][0].get<uint64_t>(), json["data_offsets"][1].get<uint64_t>()};
    if (json["shape"].size() > kMaxDims)
      Fail("tensor '{}': {} dimensions, expected at most {}", name, json["shape"].size(), kMaxDims);
    int64_t bytes = static_cast<int64_t>(c10::elementSize(dtype->type));
    bool empty = false;
    for (const Json& size : json["shape"]) {
      const auto length = static_cast<int64_t>(std::min<uint64_t>(size.get<uint64_t>(), INT64_MAX));
      empty = empty || length == 0;
      if (__builtin_mul_overflow(bytes, std::max<int64_t>(length, 1), &bytes)) {
        Fail("tensor '{}': its shape overflows", name);
      }
      entry.shape.push_back(length);
    }
    const uint64_t expected = empty ? 0 : static_cast<uint64_t>(bytes);
    if (entry.begin > entry.end || entry.end - entry.begin != expected) {
      Fail("tensor '{}': data_offsets [{}, {}] do not span the {} bytes of its shape and dtype", name, entry.begin,
           entry.end, expected);
    }
    return entry;
  }

  void CheckOffsets(std::vector<Entry>& entries, uint64_t data_bytes) const {
    std::sort(entries.begin(), entries.end(),
              [](const Entry& a, const Entry& b) { return std::tie(a.begin, a.end) < std::tie(b.begin, b.end); });
    uint64_t position = 0;
    for (const Entry& entry : entries) {
      if (entry.begin != position) {
        Fail("tensor '{}' begins at byte {}, expected {}: tensors overlap or leave a hole", entry.name, entry.begin,
             position);
      }
      position = entry.end;
    }
    if (position != data_bytes) {
      Fail("{} bytes of tensors, its header promises {}; the file is truncated or damaged", data_bytes, position);
    }
  }

  std::string path_;
  std::ifstream& stream_;
};

std::ifstream Open(const std::filesystem::path& path) {
  std::error_code code;
  if (!std::filesystem::exists(path, code)) Throw<CheckpointError>("{}: no such file", path.string());
  if (!std::filesystem::is_regular_file(path, code)) Throw<CheckpointError>("{}: expected a file", path.string());
  std::ifstream stream(path, std::ios::binary);
  if (!stream) Throw<CheckpointError>("{}: cannot be read: {}", path.string(), std::strerror(errno));
  return stream;
}

}  // namespace

void WriteSafetensors(const std::filesystem::path& path, const std::map<std::string, torch::Tensor>& tensors,
                      const std::map<std::string, std::string>& metadata) {
  // Wide types first: every tensor then lies at a multiple of its element size.
  std::vector<std::pair<std::string, torch::Tensor>> ordered(tensors.begin(), tensors.end());
  for (const auto& [name, tensor] : ordered) {
    if (name == kMetadataName) Throw<CheckpointError>("{}: a tensor may not be called '{}'", path.string(), name);
    if (!tensor.defined()) Throw<CheckpointError>("{}: tensor '{}' is undefined", path.string(), name);
    if (NameOf(tensor.scalar_type()) == nullptr) {
      Throw<CheckpointError>("{}: tensor '{}': dtype {} cannot be stored", path.string(), name,
                             c10::toString(tensor.scalar_type()));
    }
  }
  std::stable_sort(ordered.begin(), ordered.end(),
                   [](const auto& a, const auto& b) { return a.second.element_size() > b.second.element_size(); });
  Json header = Json::object();
  if (!metadata.empty()) header[kMetadataName] = metadata;
  int64_t position = 0;
  for (const auto& [name, tensor] : ordered) {
    const int64_t end = position + tensor.numel() * static_cast<int64_t>(tensor.element_size());
    header[name] = {
        {"dtype", NameOf(tensor.scalar_type())}, {"shape", tensor.sizes().vec()}, {"data_offsets", {position, end}}};
    position = end;
  }
  std::string text;
  try {
    text = header.dump();
  } catch (const Json::exception&) {
    Throw<CheckpointError>("{}: names and metadata must be UTF-8", path.string());
  }
  text.resize((text.size() + 7) / 8 * 8, ' ');

  AtomicFile file(path);
  const uint64_t header_bytes = text.size();
  file.Write(&header_bytes, 8);
  file.Write(text.data(), text.size());
  for (const auto& entry : ordered) {
    const torch::Tensor tensor = entry.second.detach().cpu().contiguous();
    file.Write(tensor.data_ptr(), static_cast<size_t>(tensor.numel()) * tensor.element_size());
  }
  file.Commit();
}

SafetensorsFile ReadSafetensors(const std::filesystem::path& path) {
  std::ifstream stream = Open(path);
  HeaderReader reader(path.string(), stream);
  Header header = reader.Read();
  SafetensorsFile file;
  file.metadata = std::move(header.metadata);
  for (const Entry& entry : header.entries) {
    torch::Tensor tensor = torch::empty(entry.shape, entry.type);
    const auto bytes = static_cast<std::streamsize>(entry.end - entry.begin);
    if (bytes > 0 && !stream.read(static_cast<char*>(tensor.data_ptr()), bytes)) {
      reader.Fail("tensor '{}' cannot be read", entry.name);
    }
    if (entry.type == torch::kBool) {
      const auto* values = static_cast<const uint8_t*>(tensor.data_ptr());
      if (std::any_of(values, values + bytes, [](uint8_t value) { return value > 1; })) {
        reader.Fail("tensor '{}': expected 0 or 1 in every BOOL", entry.name);
      }
    }
    file.tensors.emplace(entry.name, std::move(tensor));
  }
  return file;
}

std::map<std::string, std::string> ReadSafetensorsMetadata(const std::filesystem::path& path) {
  std::ifstream stream = Open(path);
  return HeaderReader(path.string(), stream).Read().metadata;
}

}  // namespace editnerf
