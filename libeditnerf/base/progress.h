// Progress of long work, with an estimate of the time left: one line that is redrawn on a terminal, plain lines at
// every tenth elsewhere. Silent at log level kWarning and above.
#pragma once

#include <cstdint>
#include <string>

#include "libeditnerf/base/clock.h"

namespace editnerf {

class Progress {
 public:
  // total > 0, in any unit; `label` is a short noun phrase ("training", "rendering").
  Progress(std::string label, double total);
  ~Progress();  // ends the line
  Progress(const Progress&) = delete;
  Progress& operator=(const Progress&) = delete;

  // `done` in the same unit as total, never decreasing; `note` is shown behind the estimate ("28.1 dB").
  void Update(double done, const std::string& note = "");
  void Finish(const std::string& note = "");

 private:
  void Draw(const std::string& note, bool last);

  std::string label_;
  double total_;
  double done_ = 0;
  bool terminal_;
  bool finished_ = false;
  int64_t last_tenth_ = -1;
  double last_drawn_ = -1;
  Stopwatch clock_;
};

// 75 -> "1:15", 3725 -> "1:02:05".
std::string FormatDuration(double seconds);

}  // namespace editnerf
