#include "libeditnerf/base/stored_zip.h"

#include <algorithm>
#include <cstdint>

#include "libeditnerf/base/error.h"

namespace editnerf {
namespace {

// The records of the format: signature, then little-endian fields at fixed offsets.
constexpr std::string_view kEndSignature("PK\5\6", 4), kDirectorySignature("PK\1\2", 4), kLocalSignature("PK\3\4", 4);
constexpr size_t kEndSize = 22, kDirectoryEntrySize = 46, kLocalHeaderSize = 30, kLongestComment = 65535;

class Reader {
 public:
  Reader(std::string_view bytes, const std::string& name) : bytes_(bytes), name_(name) {}

  [[noreturn]] void Fail(const std::string& what) const { Throw<DataError>("{}: zip archive: {}", name_, what); }

  std::string_view Slice(uint64_t offset, uint64_t length) const {
    if (offset > bytes_.size() || length > bytes_.size() - offset) {
      Fail(fmt::format("{} bytes at {} lie beyond the file's {}: it is truncated or damaged", length, offset,
                       bytes_.size()));
    }
    return bytes_.substr(offset, length);
  }

  size_t FindEnd() const {
    if (bytes_.size() < kEndSize) Fail("no end record: the file is truncated");
    const size_t earliest = bytes_.size() - std::min(bytes_.size(), kEndSize + kLongestComment);
    const size_t found = bytes_.rfind(kEndSignature, bytes_.size() - kEndSize);
    if (found == std::string_view::npos || found < earliest) Fail("no end record: the file is truncated");
    return found;
  }

 private:
  std::string_view bytes_;
  const std::string& name_;
};

uint32_t Field(std::string_view record, size_t offset, size_t size) {
  uint32_t value = 0;
  for (size_t i = size; i > 0; --i) value = value << 8 | static_cast<unsigned char>(record[offset + i - 1]);
  return value;
}

}  // namespace

std::map<std::string, std::string_view> ReadStoredZip(std::string_view bytes, const std::string& name) {
  const Reader reader(bytes, name);
  const std::string_view end = reader.Slice(reader.FindEnd(), kEndSize);
  const uint32_t count = Field(end, 10, 2);
  uint64_t cursor = Field(end, 16, 4);
  if (count == 0xffff || cursor == 0xffffffff)
    reader.Fail("more than 4 GB or 65534 entries (zip64), which is not read");

  std::map<std::string, std::string_view> entries;
  uint64_t total = 0;
  for (uint32_t i = 0; i < count; ++i) {
    const std::string_view entry = reader.Slice(cursor, kDirectoryEntrySize);
    if (entry.substr(0, 4) != kDirectorySignature) reader.Fail(fmt::format("entry {} of its directory is damaged", i));
    const uint64_t name_length = Field(entry, 28, 2);
    const std::string entry_name(reader.Slice(cursor + kDirectoryEntrySize, name_length));
    const uint32_t flags = Field(entry, 8, 2), method = Field(entry, 10, 2);
    const uint32_t stored = Field(entry, 20, 4), size = Field(entry, 24, 4), offset = Field(entry, 42, 4);
    if ((flags & 1) != 0) reader.Fail(fmt::format("'{}' is encrypted", entry_name));
    if (method != 0 || stored != size)
      reader.Fail(fmt::format("'{}' is compressed; expected stored entries", entry_name));
    if (size == 0xffffffff || offset == 0xffffffff) reader.Fail(fmt::format("'{}' has more than 4 GB", entry_name));

    const std::string_view local = reader.Slice(offset, kLocalHeaderSize);
    if (local.substr(0, 4) != kLocalSignature) reader.Fail(fmt::format("the header of '{}' is damaged", entry_name));
    const uint64_t data = uint64_t{offset} + kLocalHeaderSize + Field(local, 26, 2) + Field(local, 28, 2);
    total += size;
    if (total > bytes.size()) reader.Fail("its entries overlap");
    if (!entries.emplace(entry_name, reader.Slice(data, size)).second) {
      reader.Fail(fmt::format("two entries are called '{}'", entry_name));
    }
    cursor += kDirectoryEntrySize + name_length + Field(entry, 30, 2) + Field(entry, 32, 2);
  }
  return entries;
}

}  // namespace editnerf
