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

void WriteFileAtomically(const fs::path& path, const std::string& content) {
  const std::string temporary = path.string() + ".partial";
  const auto fail = [&](const char* what) {
    const int reason = errno;
    ::unlink(temporary.c_str());
    Throw<DataError>("{}: {}: {}", path.string(), what, std::strerror(reason));
  };
  const int file = ::open(temporary.c_str(), O_WRONLY | O_CREAT | O_TRUNC | O_CLOEXEC, 0644);
  if (file < 0) fail("cannot be written");
  size_t written = 0;
  while (written < content.size()) {
    const ssize_t count = ::write(file, content.data() + written, content.size() - written);
    if (count < 0 && errno == EINTR) continue;
    if (count <= 0) {
      const int reason = errno;
      ::close(file);
      errno = reason;
      fail("cannot be written");
    }
    written += static_cast<size_t>(count);
  }
  const bool flushed = ::fsync(file) == 0;
  if (::close(file) != 0 || !flushed) fail("cannot be written");
  if (::rename(temporary.c_str(), path.c_str()) != 0) fail("cannot be put in place");
}

void MakeFolder(const fs::path& path) {
  std::error_code code;
  fs::create_directories(path, code);
  if (code || !fs::is_directory(path)) {
    Throw<DataError>("{}: cannot be made a folder: {}", path.string(), code ? code.message() : "a file is in the way");
  }
}

}  // namespace editnerf
