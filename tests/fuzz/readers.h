// Every reader of files, as a function of bytes that may hold anything.
//
// A reader either returns or throws an editnerf::Error that names the file. Whatever else happens (another exception,
// a crash, undefined behaviour, a hang, memory for sizes that the file only claims) is a finding: its input is kept in
// tests/fuzz/findings/NAME, and the cause is removed.
//
// Readers take paths, and some read whole folders, so inputs are written to a scratch folder in memory (/dev/shm). The
// files of a folder are one input, joined by kSeparator.
#pragma once

#include <filesystem>
#include <string>
#include <vector>

namespace editnerf::fuzz {

struct Reader {
  const char* name;
  void (*read)(const std::string& input);
  std::vector<std::string> (*seeds)();  // small inputs that are read without an error
};

const std::vector<Reader>& Readers();
const Reader* FindReader(const std::string& name);  // nullptr if there is none

// Whether the input was read; false where it was refused as it should be. Lets every other exception through, and
// throws std::logic_error at an error whose message does not name the file.
bool IsRead(const Reader& reader, const std::string& input);

// The kept findings of a reader, in the source tree; may not exist.
std::filesystem::path FindingsFolder(const Reader& reader);

// --- for the readers' own files ---

inline constexpr const char* kSeparator = "\n====\n";

std::string Join(const std::vector<std::string>& files);
std::vector<std::string> Split(const std::string& input, size_t count);  // `count` files; those that lack are empty

const std::filesystem::path& InputFolder();
std::filesystem::path InputFile(const std::string& name, const std::string& content);
std::string FileContent(const std::filesystem::path& path);

std::vector<Reader> TensorReaders();  // tensor_readers.cpp: safetensors and what is kept in it, npy, torch.save
std::vector<Reader> TextReaders();    // text_readers.cpp: YAML, JSON, CSV
std::vector<Reader> FolderReaders();  // folder_readers.cpp: COLMAP, LLFF, transforms.json, key points, scene folders
std::vector<Reader> RunReaders();     // run_readers.cpp: checkpoints

}  // namespace editnerf::fuzz
