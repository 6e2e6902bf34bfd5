// Pickle opcodes by hand, so that tests can write what Python's torch.save writes, and what it never would.
#pragma once

#include <unistd.h>

#include <cstdint>
#include <filesystem>
#include <string>
#include <vector>

#include "libeditnerf/base/file.h"

namespace editnerf::testing {

inline std::string LittleEndian(uint64_t value, int num_bytes) {
  std::string bytes;
  for (int i = 0; i < num_bytes; ++i, value >>= 8) bytes += static_cast<char>(value & 0xff);
  return bytes;
}

inline const std::string kProto = std::string("\x80\x02", 2);
inline const std::string kMagic = std::string("\x80\x02\x8a\x0al\xfc\x9c\x46\xf9\x20\x6a\xa8\x50\x19.", 15);

inline std::string Text(const std::string& text) { return "X" + LittleEndian(text.size(), 4) + text; }
inline std::string Int(int64_t value) {
  return std::string("\x8a\x08") + LittleEndian(static_cast<uint64_t>(value), 8);
}
inline std::string Global(const std::string& module, const std::string& name) {
  return "c" + module + "\n" + name + "\n";
}
inline std::string Tuple(const std::vector<std::string>& items) {
  std::string all = "(";
  for (const auto& item : items) all += item;
  return all + "t";
}
inline std::string Ints(const std::vector<int64_t>& values) {
  std::vector<std::string> items;
  for (const int64_t value : values) items.push_back(Int(value));
  return Tuple(items);
}

inline std::string Storage(const std::string& type, const std::string& key, int64_t count) {
  return Tuple({Text("storage"), Global("torch", type), Text(key), Text("cpu"), Int(count)}) + "Q";
}

inline std::string TensorOf(const std::string& storage, int64_t offset, const std::vector<int64_t>& sizes,
                            const std::vector<int64_t>& strides) {
  return Global("torch._utils", "_rebuild_tensor_v2") +
         Tuple({storage, Int(offset), Ints(sizes), Ints(strides), "\x89", "N"}) + "R";
}

// One pickle: a dict with these keys and values.
inline std::string DictPickle(const std::vector<std::pair<std::string, std::string>>& entries) {
  std::string all = kProto + "}(";
  for (const auto& [key, value] : entries) all += Text(key) + value;
  return all + "u.";
}

// The legacy layout around the pickle of a dict; `storages` holds key and raw bytes with their element count in front.
inline std::string LegacyFile(const std::string& dict,
                              const std::vector<std::pair<std::string, std::string>>& storages) {
  std::string keys = kProto + "](", data;
  for (const auto& [key, bytes] : storages) keys += Text(key), data += bytes;
  return kMagic + kProto + "M" + LittleEndian(1001, 2) + "." + kProto + "}" + Text("little_endian") + "\x88s." + dict +
         keys + "e." + data;
}

inline std::string StorageData(const std::vector<float>& values) {
  return LittleEndian(values.size(), 8) +
         std::string(reinterpret_cast<const char*>(values.data()), values.size() * sizeof(float));
}

// A zip archive of stored entries, without checksums.
inline std::string StoredZip(const std::vector<std::pair<std::string, std::string>>& entries, int method = 0) {
  std::string all, directory;
  for (const auto& [name, content] : entries) {
    const std::string common = LittleEndian(0, 2) + LittleEndian(static_cast<uint64_t>(method), 2) +
                               LittleEndian(0, 8) + LittleEndian(content.size(), 4) + LittleEndian(content.size(), 4) +
                               LittleEndian(name.size(), 2);
    directory += "PK\1\2" + LittleEndian(20, 2) + LittleEndian(20, 2) + common + LittleEndian(0, 12) +
                 LittleEndian(all.size(), 4) + name;
    all += "PK\3\4" + LittleEndian(20, 2) + common + LittleEndian(0, 2) + name + content;
  }
  return all + directory + "PK\5\6" + LittleEndian(0, 4) + LittleEndian(entries.size(), 2) +
         LittleEndian(entries.size(), 2) + LittleEndian(directory.size(), 4) + LittleEndian(all.size(), 4) +
         LittleEndian(0, 2);
}

// A scratch folder of this process alone: ctest runs cases side by side.
inline std::filesystem::path ScratchFolder() {
  return std::filesystem::path(EDITNERF_BINARY_DIR) / "test_scratch" / ("evaluation_" + std::to_string(getpid()));
}

// Writes `content` to a file of this name in the scratch folder.
inline std::filesystem::path Scratch(const std::string& name, const std::string& content) {
  const auto folder = ScratchFolder();
  MakeFolder(folder);
  WriteFileAtomically(folder / name, content);
  return folder / name;
}

}  // namespace editnerf::testing
