#include "tests/fuzz/readers.h"

#include <fstream>
#include <iterator>
#include <stdexcept>

#include "libeditnerf/base/error.h"
#include "tests/imaging/scratch_folder.h"

namespace editnerf::fuzz {
namespace fs = std::filesystem;

const std::vector<Reader>& Readers() {
  static const std::vector<Reader> all = [] {
    std::vector<Reader> readers = TensorReaders();
    for (const Reader& reader : TextReaders()) readers.push_back(reader);
    for (const Reader& reader : FolderReaders()) readers.push_back(reader);
    for (const Reader& reader : RunReaders()) readers.push_back(reader);
    return readers;
  }();
  return all;
}

const Reader* FindReader(const std::string& name) {
  for (const Reader& reader : Readers())
    if (name == reader.name) return &reader;
  return nullptr;
}

bool IsRead(const Reader& reader, const std::string& input) {
  try {
    reader.read(input);
    return true;
  } catch (const Error& error) {
    const std::string message = error.what();
    if (message.find(InputFolder().string()) == std::string::npos) {
      throw std::logic_error(std::string(reader.name) + ": the message names no file: " + message);
    }
    return false;
  }
}

fs::path FindingsFolder(const Reader& reader) {
  return fs::path(EDITNERF_SOURCE_DIR) / "tests" / "fuzz" / "findings" / reader.name;
}

std::string Join(const std::vector<std::string>& files) {
  std::string input;
  for (size_t i = 0; i < files.size(); ++i) input += (i > 0 ? kSeparator : "") + files[i];
  return input;
}

std::vector<std::string> Split(const std::string& input, size_t count) {
  const size_t separator_size = std::string(kSeparator).size();
  std::vector<std::string> files;
  size_t begin = 0;
  while (files.size() + 1 < count) {
    const size_t end = input.find(kSeparator, begin);
    if (end == std::string::npos) break;
    files.push_back(input.substr(begin, end - begin));
    begin = end + separator_size;
  }
  files.push_back(input.substr(begin));
  files.resize(count);
  return files;
}

const fs::path& InputFolder() {
  static const fs::path memory = "/dev/shm";
  static const ScratchFolder folder(fs::is_directory(memory) ? memory : fs::temp_directory_path());
  return folder.path();
}

fs::path InputFile(const std::string& name, const std::string& content) {
  const fs::path path = InputFolder() / name;
  WriteText(path, content);
  return path;
}

std::string FileContent(const fs::path& path) { return ReadText(path); }

}  // namespace editnerf::fuzz
