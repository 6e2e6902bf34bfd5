#include "libeditnerf/evaluation/line_chart.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>

#include "libeditnerf/base/error.h"

namespace editnerf {
namespace {

constexpr std::array<const char*, 8> kPalette = {"#3d85e0", "#e8862e", "#2fa36b", "#d9534f",
                                                 "#9467d6", "#12a5b5", "#c2669f", "#8a8f3c"};
constexpr double kFontSize = 13, kCharacterWidth = 7.2, kLegendRow = 20, kLegendSwatch = 24, kLegendGap = 18;

// One axis: from data to pixels.
struct Axis {
  double low = 0, high = 1;
  bool is_log = false;
  double begin = 0, end = 1;  // pixels

  bool Shows(double value) const { return std::isfinite(value) && (!is_log || value > 0); }
  double Scaled(double value) const { return is_log ? std::log10(value) : value; }
  double Pixel(double value) const {
    const double fraction = (Scaled(value) - Scaled(low)) / (Scaled(high) - Scaled(low));
    return begin + (end - begin) * fraction;
  }
};

// Takes in the values; a range without extent is widened, a linear one padded by a twentieth.
Axis FitAxis(const std::vector<double>& values, bool is_log, double padding) {
  Axis axis;
  axis.is_log = is_log;
  double low = std::numeric_limits<double>::infinity(), high = -low;
  for (const double value : values) {
    if (axis.Shows(value)) low = std::min(low, value), high = std::max(high, value);
  }
  if (low > high) low = is_log ? 1 : 0, high = is_log ? 10 : 1;
  if (is_log) {
    if (high < low * 1.01) low /= 2, high *= 2;
  } else {
    if (high - low <= 1e-9 * std::max(std::abs(low), std::abs(high))) {
      const double half = std::max(0.5 * std::abs(high), 0.5);
      low -= half, high += half;
    }
    const double margin = padding * (high - low);
    low -= margin, high += margin;
  }
  axis.low = low;
  axis.high = high;
  return axis;
}

std::string Label(double value) {
  if (value == 0) return "0";
  const double size = std::abs(value);
  if (size >= 1e5 || size < 1e-4) return fmt::format("{:.3g}", value);
  return fmt::format("{:.6g}", value);
}

std::string TextElement(double x, double y, const char* anchor, const std::string& text, const char* extra = "") {
  return fmt::format("<text x=\"{:.1f}\" y=\"{:.1f}\" text-anchor=\"{}\"{}>{}</text>\n", x, y, anchor, extra,
                     EscapeMarkup(text));
}

std::string Gridline(double x1, double y1, double x2, double y2) {
  return fmt::format(
      "<line x1=\"{:.1f}\" y1=\"{:.1f}\" x2=\"{:.1f}\" y2=\"{:.1f}\" stroke=\"currentColor\" "
      "stroke-opacity=\"0.15\"/>\n",
      x1, y1, x2, y2);
}

std::string SeriesElement(const ChartSeries& series, const Axis& x, const Axis& y, const char* colour) {
  std::string path, marks;
  size_t num_in_line = 0;
  std::string last;
  const auto mark = [&](const std::string& at) {
    marks += fmt::format("<circle {} r=\"3\" fill=\"{}\"/>\n", at, colour);
  };
  const auto end_line = [&] {
    if (num_in_line == 1) mark(last);  // a line of one point would be invisible
    num_in_line = 0;
  };
  for (const auto& [vx, vy] : series.points) {
    if (!x.Shows(vx) || !y.Shows(vy)) {
      end_line();
      continue;
    }
    const double px = x.Pixel(vx), py = y.Pixel(vy);
    last = fmt::format("cx=\"{:.1f}\" cy=\"{:.1f}\"", px, py);
    if (series.is_scatter) {
      mark(last);
    } else {
      path += fmt::format("{}{:.1f} {:.1f}", num_in_line == 0 ? "M" : "L", px, py);
      ++num_in_line;
    }
  }
  end_line();
  if (path.empty()) return marks;
  return fmt::format(
             "<path d=\"{}\" fill=\"none\" stroke=\"{}\" stroke-width=\"2\" stroke-linejoin=\"round\" "
             "stroke-linecap=\"round\"/>\n",
             path, colour) +
         marks;
}

// Rows of coloured names from the left; returns the y of the last row's baseline.
double AppendLegend(const LineChart& chart, double left, double right, double y, std::string* svg) {
  double x = left;
  bool is_first = true;
  for (size_t i = 0; i < chart.series.size(); ++i) {
    const std::string& name = chart.series[i].name;
    if (name.empty()) continue;
    const double width = kLegendSwatch + kCharacterWidth * static_cast<double>(name.size()) + kLegendGap;
    if (is_first || x + width > right) x = left, y += kLegendRow;
    is_first = false;
    const char* colour = kPalette[i % kPalette.size()];
    *svg += fmt::format(
        "<line x1=\"{:.1f}\" y1=\"{:.1f}\" x2=\"{:.1f}\" y2=\"{:.1f}\" stroke=\"{}\" stroke-width=\"4\" "
        "stroke-linecap=\"round\"/>\n",
        x + 2, y - 4.5, x + kLegendSwatch - 6, y - 4.5, colour);
    *svg += TextElement(x + kLegendSwatch, y, "start", name);
    x += width;
  }
  return y;
}

}  // namespace

std::string EscapeMarkup(const std::string& text) {
  std::string escaped;
  for (const char c : text) {
    switch (c) {
      case '&':
        escaped += "&amp;";
        break;
      case '<':
        escaped += "&lt;";
        break;
      case '>':
        escaped += "&gt;";
        break;
      case '"':
        escaped += "&quot;";
        break;
      case '\'':
        escaped += "&#39;";
        break;
      default:
        escaped += static_cast<unsigned char>(c) < 0x20 && c != '\n' && c != '\t' ? ' ' : c;
    }
  }
  return escaped;
}

std::vector<double> NiceTicks(double low, double high, int count, bool is_log) {
  std::vector<double> ticks;
  if (is_log) {
    const auto first = static_cast<int>(std::floor(std::log10(low))),
               last = static_cast<int>(std::ceil(std::log10(high)));
    const int every = std::max(1, (last - first + count - 1) / std::max(count, 1));
    const bool with_folds = std::log10(high / low) < 2;
    for (int exponent = first; exponent <= last; exponent += every) {
      for (const double fold : {1.0, 2.0, 5.0}) {
        if (fold > 1 && !with_folds) continue;
        const double tick = fold * std::pow(10, exponent);
        if (tick >= low * (1 - 1e-9) && tick <= high * (1 + 1e-9)) ticks.push_back(tick);
      }
    }
    if (ticks.size() >= 2) return ticks;
    ticks.clear();  // less than a factor of two or so: linear ticks serve better
  }
  const double rough = (high - low) / std::max(count, 1);
  const double power = std::pow(10, std::floor(std::log10(rough)));
  const double step = power * (rough / power < 1.5 ? 1 : rough / power < 3.5 ? 2 : rough / power < 7.5 ? 5 : 10);
  const double slack = 1e-9 * step;
  for (double k = std::ceil((low - slack) / step); k * step <= high + slack && ticks.size() < 100; ++k) {
    ticks.push_back(k == 0 ? 0 : k * step);
  }
  return ticks;
}

std::string ToSvg(const LineChart& chart) {
  if (chart.width < 200 || chart.height < 120) {
    Throw<Error>("chart '{}': {} x {}, expected at least 200 x 120", chart.title, chart.width, chart.height);
  }
  std::vector<double> xs, ys;
  for (const ChartSeries& series : chart.series) {
    for (const auto& [x, y] : series.points) {
      const bool is_shown = std::isfinite(x) && std::isfinite(y) && (!chart.log_x || x > 0) && (!chart.log_y || y > 0);
      if (is_shown) xs.push_back(x), ys.push_back(y);
    }
  }
  Axis x = FitAxis(xs, chart.log_x, 0), y = FitAxis(ys, chart.log_y, 0.05);

  std::string svg = fmt::format(
      "<svg xmlns=\"http://www.w3.org/2000/svg\" viewBox=\"0 0 {0} {1}\" width=\"{0}\" height=\"{1}\" "
      "role=\"img\" font-family=\"system-ui, sans-serif\" font-size=\"{2}\" fill=\"currentColor\" "
      "style=\"max-width:100%;height:auto\">\n<title>{3}</title>\n",
      chart.width, chart.height, kFontSize, EscapeMarkup(chart.title));
  const auto y_ticks = NiceTicks(y.low, y.high, std::max(2, chart.height / 70), chart.log_y);
  size_t longest = 1;
  for (const double tick : y_ticks) longest = std::max(longest, Label(tick).size());
  const double left = 34 + kCharacterWidth * static_cast<double>(longest), right = chart.width - 16.0;
  double top = 22;
  svg += TextElement(left, top, "start", chart.title, " font-weight=\"600\" font-size=\"15\"");
  top = AppendLegend(chart, left, right, top + 2, &svg) + 16;
  const double bottom = std::max(chart.height - 48.0, top + 20);
  x.begin = left, x.end = right;
  y.begin = bottom, y.end = top;

  double free_from = -std::numeric_limits<double>::infinity();  // where the next label along x may begin
  for (const double tick : NiceTicks(x.low, x.high, std::max(2, chart.width / 90), chart.log_x)) {
    const std::string label = Label(tick);
    const double at = x.Pixel(tick), half = 0.5 * kCharacterWidth * static_cast<double>(label.size());
    svg += Gridline(at, top, at, bottom);
    if (at - half < free_from) continue;
    svg += TextElement(at, bottom + 18, at + half > chart.width ? "end" : "middle", label);
    free_from = at + half + 6;
  }
  for (const double tick : y_ticks) {
    svg += Gridline(left, y.Pixel(tick), right, y.Pixel(tick));
    svg += TextElement(left - 8, y.Pixel(tick) + 4.5, "end", Label(tick));
  }
  svg += fmt::format(
      "<path d=\"M{0:.1f} {1:.1f}V{2:.1f}H{3:.1f}\" fill=\"none\" stroke=\"currentColor\" "
      "stroke-opacity=\"0.6\"/>\n",
      left, top, bottom, right);
  svg += TextElement(0.5 * (left + right), chart.height - 10.0, "middle", chart.x_label, " fill-opacity=\"0.8\"");
  const std::string turned =
      fmt::format(" fill-opacity=\"0.8\" transform=\"rotate(-90 16 {0:.1f})\"", 0.5 * (top + bottom));
  svg += TextElement(16, 0.5 * (top + bottom), "middle", chart.y_label, turned.c_str());
  if (xs.empty())
    svg += TextElement(0.5 * (left + right), 0.5 * (top + bottom), "middle", "no data", " fill-opacity=\"0.6\"");
  for (size_t i = 0; i < chart.series.size(); ++i) {
    svg += SeriesElement(chart.series[i], x, y, kPalette[i % kPalette.size()]);
  }
  return svg + "</svg>\n";
}

}  // namespace editnerf
