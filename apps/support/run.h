// A program from its first line to its exit code: 0 success, 2 usage or configuration, 130 interrupted, 1 anything
// else.
//
//   int main(int argc, char** argv) {
//     std::string scene, out;
//     return editnerf::RunProgram(
//         "enf-train", "Trains an editable field.", argc, argv,
//         [&](CLI::App& app) {
//           app.add_option("SCENE", scene, "scene folder")->required();
//           app.add_option("--out", out, "run folder")->required();
//         },
//         [&](const editnerf::CommonOptions& common) { ... });
//   }
#pragma once

#include <functional>
#include <string>

#include "support/common_options.h"

namespace editnerf {

// Adds the common flags and, through `define`, the program's own; parses; installs the interrupt handler; runs `body`.
// Help, version and --print-config go to standard output, mistakes to standard error.
int RunProgram(const std::string& name, const std::string& description, int argc, const char* const* argv,
               const std::function<void(CLI::App&)>& define, const std::function<void(const CommonOptions&)>& body);

// The exit code of `body`; an exception becomes a message. A LibTorch error loses its backtrace unless the log level is
// kDebug.
int RunProgram(const std::function<void()>& body);

}  // namespace editnerf
