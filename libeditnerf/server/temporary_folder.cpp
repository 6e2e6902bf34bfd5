#include "libeditnerf/server/temporary_folder.h"

#include <stdlib.h>

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

TemporaryFolder::~TemporaryFolder() {
  std::error_code ignored;
  fs::remove_all(path_, ignored);
}

}  // namespace editnerf
