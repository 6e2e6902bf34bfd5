#include "libeditnerf/base/file.h"

#include <fcntl.h>
#include <unistd.h>

#include <cerrno>
#include <cstring>
#include <fstream>
#include <system_error>

#include "libeditnerf/base/error.h"

namespace editnerf {
namespace fs = std::filesystem;

std::string ReadFile(const fs::path& path, uintmax_t max_bytes) {
  std::error_code code;
  if (!fs::exists(path, code)) Throw<DataError>("{}: no such file", path.string());
  if (!fs::is_regular_file(path, code)) Throw<DataError>("{}: expected a file", path.string());
  const uintmax_t size = fs::file_size(path, code);
  if (code) Throw<DataError>("{}: {}", path.string(), code.message());
  if (size > max_bytes) {
    Throw<DataError>("{}: {} bytes, expected at most {}", path.string(), size, max_bytes);
  }
  std::ifstream stream(path, std::ios::binary);
  std::string content(size, '\0');
  if (!stream || !stream.read(content.data(), static_cast<std::streamsize>(size))) {
    Throw<DataError>("{}: cannot be read: {}", path.string(), std::strerror(errno));
  }
  return content;
}

AtomicFile::AtomicFile(const fs::path& path) : path_(path.string()), temporary_(path_ + ".partial") {
  file_ = ::open(temporary_.c_str(), O_WRONLY | O_CREAT | O_TRUNC | O_CLOEXEC, 0644);
  if (file_ < 0) Throw<DataError>("{}: cannot be written: {}", path_, std::strerror(errno));
}

AtomicFile::~AtomicFile() {
  if (file_ < 0) return;
  ::close(file_);
  ::unlink(temporary_.c_str());
}

void AtomicFile::Fail(const char* what) {
  Throw<DataError>("{}: {}: {}", path_, what, std::strerror(errno));  // the destructor removes the temporary file
}

void AtomicFile::Write(const void* data, size_t size) {
  const char* bytes = static_cast<const char*>(data);
  while (size > 0) {
    const ssize_t count = ::write(file_, bytes, size);
    if (count < 0 && errno == EINTR) continue;
    if (count <= 0) Fail("cannot be written");
    bytes += count;
    size -= static_cast<size_t>(count);
  }
}

void AtomicFile::Commit() {
  if (::fsync(file_) != 0) Fail("cannot be written");
  if (::rename(temporary_.c_str(), path_.c_str()) != 0) Fail("cannot be put in place");
  ::close(file_);  // what it could report, fsync has
  file_ = -1;
}

void WriteFileAtomically(const fs::path& path, const std::string& content) {
  AtomicFile file(path);
  file.Write(content.data(), content.size());
  file.Commit();
}

void MakeFolder(const fs::path& path) {
  std::error_code code;
  fs::create_directories(path, code);
  if (code || !fs::is_directory(path)) {
    Throw<DataError>("{}: cannot be made a folder: {}", path.string(), code ? code.message() : "a file is in the way");
  }
}

}  // namespace editnerf
