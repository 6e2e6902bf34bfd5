// fuzz NAME [options of libFuzzer] [CORPUS...]: one reader, with its seeds and earlier findings as a start.
// fuzz NAME FILE...: these inputs alone.
// fuzz: the readers' names.
#include <algorithm>
#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <deque>
#include <filesystem>
#include <string>
#include <vector>

#include "libeditnerf/base/error.h"
#include "libeditnerf/base/logging.h"
#include "libeditnerf/base/parallel.h"
#include "tests/fuzz/readers.h"

namespace {

using namespace editnerf;
namespace fs = std::filesystem;

constexpr const char* kReaderVariable =
    "EDITNERF_FUZZ_READER";  // for the processes that libFuzzer starts (-fork=1, ...)
const fuzz::Reader* reader = nullptr;

[[noreturn]] void ListReaders() {
  for (const fuzz::Reader& known : fuzz::Readers()) std::puts(known.name);
  std::exit(2);
}

std::deque<std::string> kept;  // arguments of our own

// The reader's name leaves the command line; folders to start from join it.
void Prepare(std::vector<char*>* arguments) {
  const char* name = std::getenv(kReaderVariable);
  if (name == nullptr) {
    if (arguments->size() < 2 || fuzz::FindReader((*arguments)[1]) == nullptr) ListReaders();
    setenv(kReaderVariable, (*arguments)[1], 1);
    name = std::getenv(kReaderVariable);
    arguments->erase(arguments->begin() + 1);
  }
  reader = fuzz::FindReader(name);
  if (reader == nullptr) ListReaders();
  if (std::any_of(arguments->begin() + 1, arguments->end(), [](char* one) { return fs::is_regular_file(one); })) return;
  const fs::path seeds = fuzz::InputFolder() / "seeds";
  for (const std::string& seed : reader->seeds()) {
    const size_t number = fs::exists(seeds) ? std::distance(fs::directory_iterator(seeds), {}) : 0;
    fuzz::InputFile("seeds/" + std::to_string(number), seed);
  }
  for (const fs::path& folder : {seeds, fuzz::FindingsFolder(*reader)}) {
    if (fs::is_directory(folder)) arguments->push_back(kept.emplace_back(folder).data());
  }
}

}  // namespace

extern "C" int LLVMFuzzerInitialize(int* argc, char*** argv) {
  SetLogLevel(LogLevel::kError);
  SetNumThreads(1);
  static std::vector<char*> arguments(*argv, *argv + *argc);
  Prepare(&arguments);
  *argc = static_cast<int>(arguments.size());
  arguments.push_back(nullptr);
  *argv = arguments.data();
  return 0;
}

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
  fuzz::IsRead(*reader, std::string(reinterpret_cast<const char*>(data), size));
  return 0;
}
