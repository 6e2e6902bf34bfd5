#include "support/run.h"

#include <c10/util/Exception.h>
#include <torch/version.h>

#include <exception>
#include <new>

#include "libeditnerf/base/error.h"
#include "libeditnerf/base/interrupt.h"
#include "libeditnerf/base/logging.h"
#include "support/thread_pools.h"

namespace editnerf {

int RunProgram(const std::string& name, const std::string& description, int argc, const char* const* argv,
               const std::function<void(CLI::App&)>& define, const std::function<void(const CommonOptions&)>& body) {
  constexpr int kUsageError = 2;
  RestartWithShortSpins(const_cast<char* const*>(argv));  // execv takes it so, and changes nothing
  CLI::App app(description, name);
  app.set_version_flag("--version", name + " " EDITNERF_VERSION " (LibTorch " TORCH_VERSION ")",
                       "print the version and exit");
  CommonFlags flags;
  define(app);
  flags.AddTo(app);
  int usage = 0;
  const int outcome = RunProgram([&] {
    try {
      app.parse(argc, argv);
    } catch (const CLI::Success& information) {  // help, version and the like
      app.exit(information);
      return;
    } catch (const CLI::ParseError& error) {
      app.exit(error);
      usage = kUsageError;
      return;
    }
    const CommonOptions options = flags.Apply();
    InstallInterruptHandler();
    body(options);
  });
  return usage != 0 ? usage : outcome;
}

int RunProgram(const std::function<void()>& body) {
  try {
    body();
    return 0;
  } catch (const Interrupted& error) {
    LogMessage(LogLevel::kWarning, error.what());
    return 130;
  } catch (const ConfigError& error) {
    LogMessage(LogLevel::kError, error.what());
    return 2;
  } catch (const c10::Error& error) {
    LogMessage(LogLevel::kError, GetLogLevel() == LogLevel::kDebug ? error.what() : error.what_without_backtrace());
    return 1;
  } catch (const std::bad_alloc&) {
    LogMessage(LogLevel::kError, "out of memory; use smaller images (data.max_side) or fewer rays per step");
    return 1;
  } catch (const std::exception& error) {
    LogMessage(LogLevel::kError, error.what());
    return 1;
  }
}

}  // namespace editnerf
