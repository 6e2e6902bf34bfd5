#include "libeditnerf/base/progress.h"

#include <fmt/format.h>
#include <unistd.h>

#include <algorithm>
#include <cmath>
#include <cstdio>

#include "libeditnerf/base/logging.h"

namespace editnerf {
namespace {

constexpr int kBarWidth = 28;
constexpr double kRedrawSeconds = 0.1;

}  // namespace

std::string FormatDuration(double seconds) {
  if (!std::isfinite(seconds) || seconds < 0) return "--:--";
  const auto whole = static_cast<int64_t>(std::llround(seconds));
  const int64_t hours = whole / 3600, minutes = whole / 60 % 60, rest = whole % 60;
  return hours > 0 ? fmt::format("{}:{:02}:{:02}", hours, minutes, rest) : fmt::format("{}:{:02}", minutes, rest);
}

Progress::Progress(std::string label, double total)
    : label_(std::move(label)), total_(std::max(total, 1e-12)), terminal_(isatty(STDERR_FILENO) != 0) {}

Progress::~Progress() {
  if (!finished_ && terminal_ && last_drawn_ >= 0) std::fputc('\n', stderr);
}

void Progress::Update(double done, const std::string& note) {
  if (finished_ || GetLogLevel() > LogLevel::kInfo) return;
  done_ = std::max(done_, std::min(done, total_));
  const double now = clock_.Seconds();
  if (terminal_) {
    if (last_drawn_ >= 0 && now - last_drawn_ < kRedrawSeconds) return;
    last_drawn_ = now;
    Draw(note, false);
    return;
  }
  const auto tenth = static_cast<int64_t>(10 * done_ / total_);
  if (tenth == last_tenth_) return;
  last_tenth_ = tenth;
  Draw(note, false);
}

void Progress::Finish(const std::string& note) {
  if (finished_) return;
  if (GetLogLevel() <= LogLevel::kInfo) {
    done_ = total_;
    Draw(note, true);
  }
  finished_ = true;
}

void Progress::Draw(const std::string& note, bool last) {
  const double fraction = done_ / total_;
  const double elapsed = clock_.Seconds();
  const std::string time = last           ? fmt::format("in {}", FormatDuration(elapsed))
                           : fraction > 0 ? fmt::format("{} left", FormatDuration(elapsed * (1 / fraction - 1)))
                                          : std::string("estimating");
  const std::string tail = note.empty() ? "" : "  " + note;
  if (!terminal_) {
    LogInfo("{} {:3.0f}%  {}{}", label_, 100 * fraction, time, tail);
    return;
  }
  const int filled = static_cast<int>(fraction * kBarWidth);
  std::string bar;
  for (int i = 0; i < kBarWidth; ++i) bar += i < filled ? "█" : "░";
  const std::string line =
      fmt::format("\r\033[K{:<12} {} {:3.0f}%  {}{}{}", label_, bar, 100 * fraction, time, tail, last ? "\n" : "");
  std::fputs(line.c_str(), stderr);
  std::fflush(stderr);
}

}  // namespace editnerf
