// Another program as a child process: an argument vector (no shell), its output in a file, stopped by Ctrl-C.
#pragma once

#include <filesystem>
#include <functional>
#include <string>
#include <utility>
#include <vector>

namespace editnerf {

struct ChildProcess {
  std::vector<std::string> arguments;  // the program first: a path, or a name that is looked up on PATH
  std::vector<std::pair<std::string, std::string>> environment;  // added to this process's own
  std::filesystem::path log;                                     // standard output and standard error are appended here
  std::function<void(const std::string&)> on_line;  // called with each complete new line of the log; may be empty
};

// Runs to the end and returns the exit code (128 + the signal's number where a signal ended it). On an interrupt
// request the child is terminated and Interrupted is thrown. Throws DataError where the program cannot be started.
int RunChild(const ChildProcess& child);

}  // namespace editnerf
