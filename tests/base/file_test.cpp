#include "libeditnerf/base/file.h"

#include <filesystem>
#include <string>

#include "libeditnerf/base/error.h"
#include "tests/catch.h"

namespace editnerf {
namespace {

namespace fs = std::filesystem;

struct TemporaryFolder {
  TemporaryFolder() {
    std::string name = (fs::temp_directory_path() / "editnerf_file_XXXXXX").string();
    REQUIRE(::mkdtemp(name.data()) != nullptr);
    path = name;
  }
  ~TemporaryFolder() { fs::remove_all(path); }
  int64_t FileCount() const { return std::distance(fs::directory_iterator(path), fs::directory_iterator()); }
  fs::path path;
};

// The message of the DataError that `body` throws.
template <class Body>
std::string ErrorOf(const Body& body) {
  try {
    body();
  } catch (const DataError& error) {
    return error.what();
  }
  return "no error";
}

}  // namespace

TEST_CASE("a file that is written in pieces appears as a whole") {
  const TemporaryFolder folder;
  const fs::path path = folder.path / "a";
  WriteFileAtomically(path, "old");
  {
    AtomicFile file(path);
    file.Write("ne", 2);
    file.Write("", 0);
    file.Write("w\0", 2);
    CHECK(ReadFile(path) == "old");
    file.Commit();
  }
  CHECK(ReadFile(path) == std::string("new\0", 4));
  CHECK(folder.FileCount() == 1);
}

TEST_CASE("a file that is given up leaves the old content and nothing else") {
  const TemporaryFolder folder;
  const fs::path path = folder.path / "a";
  WriteFileAtomically(path, "old");
  { AtomicFile(path).Write("new", 3); }
  CHECK(ReadFile(path) == "old");
  CHECK(folder.FileCount() == 1);
}

TEST_CASE("files that cannot be read or written are named with the reason") {
  const TemporaryFolder folder;
  const std::string missing = (folder.path / "missing").string(), below = (folder.path / "missing/a").string();
  CHECK(ErrorOf([&] { ReadFile(missing); }) == missing + ": no such file");
  CHECK(ErrorOf([&] { ReadFile(folder.path); }) == folder.path.string() + ": expected a file");
  CHECK(ErrorOf([&] { WriteFileAtomically(below, "x"); }) == below + ": cannot be written: No such file or directory");
  CHECK(ErrorOf([&] { WriteFileAtomically(folder.path, "x"); }).find("cannot be put in place") != std::string::npos);
  WriteFileAtomically(folder.path / "long", "12345");
  CHECK(ErrorOf([&] { ReadFile(folder.path / "long", 4); }) ==
        (folder.path / "long").string() + ": 5 bytes, expected at most 4");
  CHECK(ErrorOf([&] { MakeFolder(folder.path / "long"); }).find("cannot be made a folder") != std::string::npos);
}

}  // namespace editnerf
