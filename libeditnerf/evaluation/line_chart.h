// A line chart as an SVG string: for reports and documents, without any other program.
//
// Axes and text take the colour of the surrounding text (currentColor), and the series' colours are of middle
// lightness, so that one picture reads on light and on dark pages.
#pragma once

#include <string>
#include <utility>
#include <vector>

namespace editnerf {

struct ChartSeries {
  std::string name;  // in the legend; empty: not there
  std::vector<std::pair<double, double>>
      points;               // x, y in drawing order; a point that is not finite interrupts the line
  bool is_scatter = false;  // marks instead of a line
};

struct LineChart {
  std::string title, x_label, y_label;
  std::vector<ChartSeries> series;
  bool log_x = false, log_y = false;  // points that are not positive are left out then
  int width = 720, height = 400;      // of the view box; the picture scales with its container
};

// A complete <svg> element, which is also a complete file. Throws Error when the size is below 200 x 120.
std::string ToSvg(const LineChart& chart);

// Round numbers (1, 2 or 5 times a power of ten) that divide [low, high] into about `count` steps; for a logarithmic
// axis powers of ten, with their 2 and 5 folds where the range is short. All lie inside the range. low < high, and 0 <
// low if is_log.
std::vector<double> NiceTicks(double low, double high, int count, bool is_log);

// Text safe inside XML and HTML, in elements and in quoted attributes; characters that XML forbids become spaces.
std::string EscapeMarkup(const std::string& text);

}  // namespace editnerf
