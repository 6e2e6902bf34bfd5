// Messages to the person at the terminal. The library never prints by itself: all text goes through here, to standard
// error by default, and a program may raise or lower the level or send it elsewhere.
#pragma once

#include <fmt/format.h>

#include <functional>
#include <string>
#include <utility>

namespace editnerf {

enum class LogLevel { kDebug, kInfo, kWarning, kError };

void SetLogLevel(LogLevel level);
LogLevel GetLogLevel();

// Replaces the sink; an empty function restores standard error. Calls are serialised.
void SetLogSink(std::function<void(LogLevel, const std::string&)> sink);

void LogMessage(LogLevel level, const std::string& message);

template <class... Args>
void LogDebug(fmt::format_string<Args...> format, Args&&... args) {
  if (GetLogLevel() <= LogLevel::kDebug) LogMessage(LogLevel::kDebug, fmt::format(format, std::forward<Args>(args)...));
}
template <class... Args>
void LogInfo(fmt::format_string<Args...> format, Args&&... args) {
  if (GetLogLevel() <= LogLevel::kInfo) LogMessage(LogLevel::kInfo, fmt::format(format, std::forward<Args>(args)...));
}
template <class... Args>
void LogWarning(fmt::format_string<Args...> format, Args&&... args) {
  LogMessage(LogLevel::kWarning, fmt::format(format, std::forward<Args>(args)...));
}

}  // namespace editnerf
