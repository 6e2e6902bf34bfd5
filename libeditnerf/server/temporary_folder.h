// A folder of one's own that goes, with all that is in it, when its owner does.
#pragma once

#include <filesystem>

namespace editnerf {

class TemporaryFolder {
 public:
  TemporaryFolder();  // throws DataError where none can be made
  ~TemporaryFolder();
  TemporaryFolder(const TemporaryFolder&) = delete;
  TemporaryFolder& operator=(const TemporaryFolder&) = delete;

  // Made anew, empty, where it was deleted meanwhile, as systems do that clean up what is old. Throws DataError where
  // that cannot be done.
  void Restore() const;

  std::filesystem::path operator/(const char* name) const { return path_ / name; }

 private:
  std::filesystem::path path_;
};

}  // namespace editnerf
