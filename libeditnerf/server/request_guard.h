// Who may talk to the editor: only pages that it served itself, to people who have its address with the token.
//
// A browser sends any page's requests to a program on the same machine. Three things keep other pages out: a token that
// they cannot know; the Origin header, which a browser adds to a page's requests and the page cannot change; and
// the Host header, which shows the name that was asked for, so that a name that somebody lets point at this machine
// later (DNS rebinding) is refused.
#pragma once

#include <string>
#include <vector>

namespace editnerf {

struct GuardOptions {
  std::string token;               // not empty
  bool loopback_only = true;       // otherwise any numeric address is a good Host: it cannot be rebound
  std::vector<std::string> hosts;  // more names, without ports; those are good in Origin as well
};

struct RequestHeaders {
  std::string token;   // from the query or from X-Editor-Token; empty: none
  std::string host;    // "localhost:8088"
  std::string origin;  // "http://localhost:8088"; empty: none
};

// Why the request is refused; empty where it is not.
std::string WhyRefused(const RequestHeaders& headers, const GuardOptions& options);

// 32 hexadecimal digits from the system's random numbers.
std::string RandomToken();

}  // namespace editnerf
