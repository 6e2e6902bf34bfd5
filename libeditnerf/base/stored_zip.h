// Entries of a zip archive that are stored without compression, as torch.save and numpy.savez write them.
#pragma once

#include <map>
#include <string>
#include <string_view>

namespace editnerf {

// Name -> content, as views into `bytes`, which must outlive them. Every offset and length is checked against the file.
// Throws DataError, beginning with "name: ", at a damaged directory, a compressed or encrypted entry, two entries of
// one name, overlapping entries, and archives above 4 GB (zip64).
std::map<std::string, std::string_view> ReadStoredZip(std::string_view bytes, const std::string& name);

}  // namespace editnerf
