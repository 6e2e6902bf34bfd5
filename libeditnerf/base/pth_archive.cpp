#include "libeditnerf/base/pth_archive.h"

#include <algorithm>
#include <cstring>
#include <string_view>

#include "libeditnerf/base/error.h"
#include "libeditnerf/base/file.h"
#include "libeditnerf/base/restricted_pickle.h"
#include "libeditnerf/base/stored_zip.h"

namespace editnerf {
namespace {

using Kind = PickleValue::Kind;
using Storages = std::map<std::string, torch::Tensor>;

// The number 0x1950a86a20f9469cfc6c as a pickle of its own.
constexpr std::string_view kLegacyMagic("\x80\x02\x8a\x0al\xfc\x9c\x46\xf9\x20\x6a\xa8\x50\x19.", 15);
constexpr int64_t kLegacyVersion = 1001;

// One-dimensional tensor with the bytes of a storage.
torch::Tensor StorageTensor(std::string_view bytes, const PickleValue& storage, const std::string& name) {
  if (storage.type == torch::kBool &&
      std::any_of(bytes.begin(), bytes.end(), [](char value) { return (value & ~1) != 0; })) {
    Throw<DataError>("{}: storage '{}': expected 0 or 1 in every truth value", name, storage.text);
  }
  auto tensor = torch::empty({static_cast<int64_t>(bytes.size() / c10::elementSize(storage.type))}, storage.type);
  if (!bytes.empty()) std::memcpy(tensor.data_ptr(), bytes.data(), bytes.size());
  return tensor;
}

// Every storage that tensors of the pickle refer to, by key, with one type and size each.
std::map<std::string, const PickleValue*> DeclaredStorages(const Pickle& pickle, const std::string& name) {
  std::map<std::string, const PickleValue*> declared;
  for (const PickleValue& value : pickle.values) {
    if (value.kind != Kind::kStorage) continue;
    const auto [entry, is_new] = declared.emplace(value.text, &value);
    if (!is_new && (entry->second->type != value.type || entry->second->integer != value.integer)) {
      Throw<DataError>("{}: storage '{}' is declared twice, with different types or sizes", name, value.text);
    }
  }
  return declared;
}

// Bytes of a storage of `count` elements, of which `available` are in the file.
uint64_t StorageBytes(const PickleValue& storage, uint64_t available, const std::string& name) {
  const uint64_t size = c10::elementSize(storage.type);
  const auto count = static_cast<uint64_t>(storage.integer);
  if (count > available / size) {
    Throw<DataError>(
        "{}: storage '{}' has {} elements of {} bytes, but {} bytes are left: the file is truncated or damaged", name,
        storage.text, count, size, available);
  }
  return count * size;
}

std::map<std::string, torch::Tensor> Assemble(const Pickle& pickle, const Storages& storages, const std::string& name) {
  const PickleValue& root = pickle.Root();
  if (root.kind != Kind::kDict) Throw<DataError>("{}: found {}, expected a dict of tensors", name, KindName(root.kind));
  std::map<std::string, torch::Tensor> tensors;
  for (size_t i = 0; i + 1 < root.items.size(); i += 2) {
    const PickleValue& key = pickle.values[root.items[i]];
    const PickleValue& value = pickle.values[root.items[i + 1]];
    if (key.kind != Kind::kString)
      Throw<DataError>("{}: found {} as a key, expected a string", name, KindName(key.kind));
    if (value.kind != Kind::kTensor) {
      Throw<DataError>("{}: entry '{}' is {}, expected a tensor; save the state dict alone", name, key.text,
                       KindName(value.kind));
    }
    const auto storage = storages.find(pickle.values[value.items[0]].text);
    if (storage == storages.end()) Throw<DataError>("{}: the data of '{}' is missing", name, key.text);
    tensors[key.text] = storage->second.as_strided(value.sizes, value.strides, value.integer);
  }
  return tensors;
}

std::map<std::string, torch::Tensor> ReadLegacy(std::string_view bytes, const std::string& name) {
  bytes.remove_prefix(kLegacyMagic.size());
  const auto next = [&] {
    Pickle pickle = ReadPickle(bytes, name);
    bytes.remove_prefix(pickle.length);
    return pickle;
  };
  const Pickle version = next();
  if (version.Root().kind != Kind::kInt || version.Root().integer != kLegacyVersion) {
    Throw<DataError>("{}: layout version {}, expected {}", name, version.Root().integer, kLegacyVersion);
  }
  const Pickle system = next();
  for (size_t i = 0; i + 1 < system.Root().items.size(); i += 2) {
    if (system.values[system.Root().items[i]].text == "little_endian" &&
        system.values[system.Root().items[i + 1]].integer == 0) {
      Throw<DataError>("{}: written on a big-endian machine; save it again on a little-endian one", name);
    }
  }
  const Pickle dict = next();
  const auto declared = DeclaredStorages(dict, name);
  const Pickle keys = next();
  if (keys.Root().kind != Kind::kList) Throw<DataError>("{}: expected the list of storages after the dict", name);

  Storages storages;
  for (const size_t item : keys.Root().items) {
    const std::string& key = keys.values[item].text;
    const auto found = declared.find(key);
    if (found == declared.end()) Throw<DataError>("{}: storage '{}' belongs to no tensor", name, key);
    if (bytes.size() < 8) Throw<DataError>("{}: the file ends before storage '{}'", name, key);
    int64_t count = 0;
    std::memcpy(&count, bytes.data(), sizeof count);
    bytes.remove_prefix(sizeof count);
    if (count != found->second->integer) {
      Throw<DataError>("{}: storage '{}' has {} elements, expected {}", name, key, count, found->second->integer);
    }
    const uint64_t size = StorageBytes(*found->second, bytes.size(), name);
    storages[key] = StorageTensor(bytes.substr(0, size), *found->second, name);
    bytes.remove_prefix(size);
  }
  return Assemble(dict, storages, name);
}

std::map<std::string, torch::Tensor> ReadZip(std::string_view bytes, const std::string& name) {
  constexpr std::string_view kPickleName = "data.pkl";
  const auto entries = ReadStoredZip(bytes, name);
  std::string folder;
  const std::string_view* pickle_bytes = nullptr;
  for (const auto& [entry, content] : entries) {
    const size_t slash = entry.find('/');
    if (slash != std::string::npos && entry.substr(slash + 1) == kPickleName) {
      folder = entry.substr(0, slash + 1);
      pickle_bytes = &content;
    }
  }
  if (pickle_bytes == nullptr)
    Throw<DataError>("{}: a zip archive without {}: not written by torch.save", name, kPickleName);
  const auto order = entries.find(folder + "byteorder");
  if (order != entries.end() && order->second != "little") {
    Throw<DataError>("{}: byte order '{}', expected little", name, order->second);
  }
  const Pickle dict = ReadPickle(*pickle_bytes, name);
  Storages storages;
  for (const auto& [key, storage] : DeclaredStorages(dict, name)) {
    const auto data = entries.find(folder + "data/" + key);
    if (data == entries.end()) Throw<DataError>("{}: the data of storage '{}' is missing", name, key);
    const uint64_t size = StorageBytes(*storage, data->second.size(), name);
    storages[key] = StorageTensor(data->second.substr(0, size), *storage, name);
  }
  return Assemble(dict, storages, name);
}

}  // namespace

std::map<std::string, torch::Tensor> ReadPthArchive(const std::filesystem::path& path) {
  const std::string content = ReadFile(path);
  const std::string_view bytes = content;
  const std::string name = path.string();
  if (bytes.substr(0, kLegacyMagic.size()) == kLegacyMagic) return ReadLegacy(bytes, name);
  if (bytes.substr(0, 4) == std::string_view("PK\3\4", 4)) return ReadZip(bytes, name);
  Throw<DataError>("{}: not a file written by torch.save (neither its legacy nor its zip layout)", name);
}

}  // namespace editnerf
