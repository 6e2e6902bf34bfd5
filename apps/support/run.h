// Exceptions become messages and exit codes: 0 success, 2 usage or configuration, 130 interrupted, 1 anything else.
#pragma once

#include <functional>

namespace editnerf {

// Runs `body` and returns the process's exit code. A LibTorch error loses its backtrace unless the log level is kDebug.
int RunProgram(const std::function<void()>& body);

}  // namespace editnerf
