// What the editor's requests hold. All throw DataErrors that name the field, what was expected and what was found.
#pragma once

#include <cstddef>
#include <cstdint>
#include <string>
#include <vector>

#include "libeditnerf/editing/motion_transfer.h"
#include "libeditnerf/imaging/json_file.h"

namespace editnerf {

Json ParseRequest(const std::string& body);  // an object

std::string TabName(const Json& body);  // empty where it is missing, which is no tab's name
bool JsonFlag(const Json& object, const char* name, const std::string& where);  // false where it is missing
const Json& JsonList(const Json& body, const char* name, size_t most);
std::vector<FramePair> FramePairsOf(const Json& body);  // "pairs": [[video frame, row of the training frames], ...]

// Of an address's parameters, without a sign; and pictures a second, 24 where none are given.
int64_t WholeNumberIn(const std::string& text, const char* name);
double Fps(const std::string& text);

}  // namespace editnerf
