#include "support/run.h"

#include <c10/util/Exception.h>

#include <exception>

#include "libeditnerf/base/error.h"
#include "libeditnerf/base/logging.h"

namespace editnerf {

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
