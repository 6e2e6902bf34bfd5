#include "libeditnerf/server/request_guard.h"

#include <fmt/format.h>

#include <algorithm>
#include <cctype>
#include <random>

namespace editnerf {
namespace {

std::string Lower(std::string text) {
  std::transform(text.begin(), text.end(), text.begin(),
                 [](char c) { return static_cast<char>(std::tolower(static_cast<unsigned char>(c))); });
  return text;
}

// "localhost:8088" -> "localhost", "[::1]:8088" -> "[::1]".
std::string NameOf(const std::string& authority) {
  if (!authority.empty() && authority.front() == '[') return Lower(authority.substr(0, authority.find(']') + 1));
  return Lower(authority.substr(0, authority.find(':')));
}

bool IsLoopback(const std::string& name) { return name == "localhost" || name == "127.0.0.1" || name == "[::1]"; }

bool IsNumeric(const std::string& name) {
  if (!name.empty() && name.front() == '[') return true;
  return !name.empty() && name.find_first_not_of("0123456789.") == std::string::npos;
}

// In a time that does not tell how many characters are right.
bool SameToken(const std::string& given, const std::string& token) {
  if (given.size() != token.size()) return false;
  unsigned difference = 0;
  for (size_t i = 0; i < token.size(); ++i) difference |= static_cast<unsigned char>(given[i] ^ token[i]);
  return difference == 0;
}

}  // namespace

std::string WhyRefused(const RequestHeaders& headers, const GuardOptions& options) {
  const auto named = [&](const std::string& name) {
    return std::any_of(options.hosts.begin(), options.hosts.end(),
                       [&](const std::string& host) { return Lower(host) == name; });
  };
  const std::string host = NameOf(headers.host);
  if (!IsLoopback(host) && !named(host) && (options.loopback_only || !IsNumeric(host))) {
    return fmt::format("the host '{}' is not this editor's; name it with --allow-host if it should be", host);
  }
  if (!headers.origin.empty()) {
    const size_t scheme = headers.origin.find("://");
    const std::string authority = scheme == std::string::npos ? "" : headers.origin.substr(scheme + 3);
    if (Lower(authority) != Lower(headers.host) && !named(NameOf(authority))) {
      return fmt::format("the page at '{}' is not this editor's", headers.origin);
    }
  }
  if (headers.token.empty()) return "the token is missing; open the address that enf-edit printed";
  if (!SameToken(headers.token, options.token)) {
    return "the token is wrong; open the address that enf-edit printed when it was started last";
  }
  return "";
}

std::string RandomToken() {
  std::random_device random;
  std::string token;
  for (int i = 0; i < 4; ++i) token += fmt::format("{:08x}", random());
  return token;
}

}  // namespace editnerf
