// Bytes as text (RFC 4648), for pictures inside JSON.
#pragma once

#include <string>

namespace editnerf {

std::string Base64(const std::string& bytes);  // "M" -> "TQ=="

}  // namespace editnerf
