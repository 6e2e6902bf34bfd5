#include "libeditnerf/server/temporary_folder.h"

#include <stdlib.h>
#include <sys/stat.h>

#include <cerrno>

#include <string>
#include <system_error>

#include "libeditnerf/base/error.h"

namespace editnerf {
namespace fs = std::filesystem;

TemporaryFolder::TemporaryFolder() {
  std::string pattern = (fs::temp_directory_path() / "enf-edit-XXXXXX").string();
  if (::mkdtemp(pattern.data()) == nullptr) Throw<DataError>("{}: no temporary folder can be made", pattern);
  path_ = pattern;
}

void TemporaryFolder::Restore() const {
  // For its owner alone, as mkdtemp makes it; one that is there is not touched.
  if (::mkdir(path_.c_str(), 0700) == 0 || errno == EEXIST) return;
  Throw<DataError>("{}: the temporary folder was deleted and cannot be made anew; start the editor again",
                   path_.string());
}

TemporaryFolder::~TemporaryFolder() {
  std::error_code ignored;
  fs::remove_all(path_, ignored);
}

}  // namespace editnerf
