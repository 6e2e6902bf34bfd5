// enf-edit RUN: drag a run's key points in the browser.
#include <sys/stat.h>

#include <cstdio>
#include <filesystem>
#include <string>

#include "editor/editor_page.h"
#include "libeditnerf/base/error.h"
#include "libeditnerf/base/file.h"
#include "libeditnerf/base/interrupt.h"
#include "libeditnerf/base/logging.h"
#include "libeditnerf/server/editor_server.h"
#include "libeditnerf/server/request_guard.h"
#include "support/run.h"

namespace {

struct Request {
  std::filesystem::path run, token_file;
  editnerf::EditorServerOptions server;
};

void Define(CLI::App& app, Request& request) {
  request.server.port = 8088;
  request.server.any_port_if_taken = true;
  app.add_option("RUN", request.run, "run folder of enf-train")->required();
  app.add_option_function<int>(
         "--port",
         [&request](int port) {
           request.server.port = port;
           request.server.any_port_if_taken = false;
         },
         "port to listen on; 0 for any that is free; by default 8088, or any where that is taken")
      ->type_name("P")
      ->check(CLI::Range(0, 65535).description(""));
  app.add_option("--host", request.server.host,
                 "address to listen on; others than this machine's own still need the token")
      ->capture_default_str();
  app.add_option("--allow-host", request.server.allow_hosts,
                 "one more name by which the editor is reached, such as a proxy's; repeatable")
      ->type_name("NAME")
      ->allow_extra_args(false);
  app.add_option("--token-file", request.token_file,
                 "keeps the token, so that the address stays the same when the editor is started again, and open pages "
                 "go on; made where it is not there");
}

std::string TokenOf(const std::filesystem::path& file) {
  if (file.empty()) return editnerf::RandomToken();
  if (!std::filesystem::exists(file)) {
    const std::string token = editnerf::RandomToken();
    const mode_t before = ::umask(077);  // for its owner's eyes
    editnerf::WriteFileAtomically(file, token);
    ::umask(before);
    return token;
  }
  const std::string token = editnerf::ReadFile(file);
  if (token.size() < 16 || token.find_first_not_of("0123456789abcdef") != std::string::npos) {
    editnerf::Throw<editnerf::ConfigError>(
        "--token-file {}: expected at least 16 hexadecimal digits and nothing else; remove it to get a new one",
        file.string());
  }
  return token;
}

}  // namespace

int main(int argc, char** argv) {
  Request request;
  return editnerf::RunProgram(
      "enf-edit", "Edits a run in the browser: drag its key points, look from anywhere, make a video.", argc, argv,
      [&](CLI::App& app) { Define(app, request); },
      [&](const editnerf::CommonOptions& common) {
        if (common.config_given || !common.overrides.empty()) {
          editnerf::LogWarning("a run is shown as it was trained: --config and --set change nothing here");
        }
        request.server.token = TokenOf(request.token_file);
        request.server.page = editnerf::EditorPage();
        request.server.title = std::filesystem::absolute(request.run).lexically_normal().filename().string();
        editnerf::EditorServer server(editnerf::LoadRun(request.run, common.device), request.server);
        // The address is what the program is run for: to standard output, whatever the log level.
        std::printf("%s\n", server.Url().c_str());
        std::fflush(stdout);
        editnerf::LogInfo("open this address in a browser; Ctrl-C ends the editor");
        server.Serve(editnerf::InterruptRequested);
      });
}
