// Whole files in and out. Writing is atomic: a temporary file beside the target, flushed to disk, then renamed, so
// that a full disk or a crash leaves what was there before.
#pragma once

#include <cstddef>
#include <filesystem>
#include <string>

namespace editnerf {

// Throws DataError naming the path when it cannot be read, or holds more than max_bytes.
std::string ReadFile(const std::filesystem::path& path, uintmax_t max_bytes = uintmax_t{1} << 33);

// A file that is written piece by piece and appears as a whole: Commit puts it in place; without it, or after an error,
// the old content stays and the temporary file is removed. All errors are DataErrors that name the path and the
// system's reason ("No space left on device").
class AtomicFile {
 public:
  explicit AtomicFile(const std::filesystem::path& path);
  ~AtomicFile();
  AtomicFile(const AtomicFile&) = delete;
  AtomicFile& operator=(const AtomicFile&) = delete;

  void Write(const void* data, size_t size);
  void Commit();  // at most once, nothing is written after it

 private:
  [[noreturn]] void Fail(const char* what);  // with errno as the reason

  std::string path_;
  std::string temporary_;
  int file_ = -1;
};

// The whole content at once; throws as AtomicFile does.
void WriteFileAtomically(const std::filesystem::path& path, const std::string& content);

// Creates the folder and its parents; throws DataError naming it.
void MakeFolder(const std::filesystem::path& path);

}  // namespace editnerf
