// The library's errors. Every message says where, what was found and what was expected, and, for a user's mistake,
// what to do. Programs turn them into exit codes: ConfigError 2, everything else 1.
#pragma once

#include <fmt/format.h>

#include <stdexcept>
#include <string>
#include <utility>

namespace editnerf {

class Error : public std::runtime_error {
 public:
  using std::runtime_error::runtime_error;
};

// A setting, a flag or a combination of them that cannot work.
class ConfigError : public Error {
 public:
  using Error::Error;
};

// A tensor of the wrong shape, type or device: a mistake of the calling code.
class ShapeError : public Error {
 public:
  using Error::Error;
};

// An input file or data set that is missing, damaged or inconsistent.
class DataError : public Error {
 public:
  using Error::Error;
};

// A checkpoint that cannot be read, or that belongs to another configuration.
class CheckpointError : public Error {
 public:
  using Error::Error;
};

// The user asked to stop (Ctrl-C); what was done so far is on disk.
class Interrupted : public Error {
 public:
  using Error::Error;
};

// Throw<DataError>("{}: expected {} values, found {}", path, 3, n);
template <class E, class... Args>
[[noreturn]] void Throw(fmt::format_string<Args...> format, Args&&... args) {
  throw E(fmt::format(format, std::forward<Args>(args)...));
}

}  // namespace editnerf
