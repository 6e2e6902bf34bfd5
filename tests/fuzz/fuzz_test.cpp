// The readers of fuzzing in an ordinary build: their seeds, simple damage to each of them, and everything that was
// found.
#include "libeditnerf/base/error.h"
#include "tests/catch.h"
#include "tests/fuzz/readers.h"

using namespace editnerf;

namespace {

// All that a reader may do; the message of anything else is the test's.
bool IsReadOrRefused(const fuzz::Reader& reader, const std::string& input) {
  try {
    fuzz::IsRead(reader, input);
    return true;
  } catch (const std::exception& error) {
    UNSCOPED_INFO(reader.name << ": " << error.what());
    return false;
  }
}

}  // namespace

TEST_CASE("every reader of fuzzing reads its seeds") {
  for (const fuzz::Reader& reader : fuzz::Readers()) {
    const auto seeds = reader.seeds();
    CHECK_FALSE(seeds.empty());
    for (size_t i = 0; i < seeds.size(); ++i) {
      INFO(reader.name << ": seed " << i);
      CHECK(fuzz::IsRead(reader, seeds[i]));
    }
  }
}

TEST_CASE("every reader reads or refuses a file that is cut or has a byte changed") {
  constexpr size_t kPlaces = 150;  // in each seed
  for (const fuzz::Reader& reader : fuzz::Readers()) {
    int64_t num_wrong = 0;
    for (const std::string& seed : reader.seeds()) {
      const size_t stride = 1 + seed.size() / kPlaces;
      for (size_t at = 0; at < seed.size(); at += stride) {
        num_wrong += !IsReadOrRefused(reader, seed.substr(0, at));
        for (const unsigned char flip : {0x01, 0x10, 0x80, 0xff}) {
          std::string changed = seed;
          changed[at] = static_cast<char>(static_cast<unsigned char>(changed[at]) ^ flip);
          num_wrong += !IsReadOrRefused(reader, changed);
        }
      }
    }
    INFO(reader.name);
    CHECK(num_wrong == 0);
  }
}

TEST_CASE("what fuzzing found is refused") {
  int64_t num_findings = 0;
  for (const fuzz::Reader& reader : fuzz::Readers()) {
    if (!std::filesystem::is_directory(fuzz::FindingsFolder(reader))) continue;
    for (const auto& entry : std::filesystem::directory_iterator(fuzz::FindingsFolder(reader))) {
      INFO(entry.path().string());
      CHECK_FALSE(fuzz::IsRead(reader, fuzz::FileContent(entry.path())));
      ++num_findings;
    }
  }
  CHECK(num_findings > 0);
}
