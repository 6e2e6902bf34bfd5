// Whole files in and out. Writing is atomic: a temporary file beside the target, flushed to disk, then renamed, so
// that a full disk or a crash leaves what was there before.
#pragma once

#include <filesystem>
#include <string>

namespace editnerf {

// Throws DataError naming the path when it cannot be read, or holds more than max_bytes.
std::string ReadFile(const std::filesystem::path& path, uintmax_t max_bytes = uintmax_t{1} << 33);

// Throws DataError naming the path and the system's reason ("No space left on device"); the old content stays.
void WriteFileAtomically(const std::filesystem::path& path, const std::string& content);

// Creates the folder and its parents; throws DataError naming it.
void MakeFolder(const std::filesystem::path& path);

}  // namespace editnerf
