#include "libeditnerf/evaluation/line_chart.h"

#include <cmath>
#include <limits>

#include "libeditnerf/base/error.h"
#include "tests/catch.h"
#include "tests/evaluation/markup_check.h"

using namespace editnerf;
using editnerf::testing::MarkupProblem;

namespace {

size_t Count(const std::string& text, const std::string& part) {
  size_t count = 0;
  for (size_t at = text.find(part); at != std::string::npos; at = text.find(part, at + 1)) ++count;
  return count;
}

}  // namespace

TEST_CASE("the markup check finds what is malformed") {
  CHECK(MarkupProblem("<a b=\"1\"><c/>x &amp; y</a>").empty());
  for (const char* bad :
       {"<a>", "</a>", "<a></b>", "<a b=1></a>", "<a b=\"1\" b=\"2\"></a>", "x & y", "a < b", "<a b=\"<\"></a>"}) {
    CHECK_FALSE(MarkupProblem(bad).empty());
  }
}

TEST_CASE("ticks are round numbers inside the range") {
  CHECK(NiceTicks(0, 10, 5, false) == std::vector<double>{0, 2, 4, 6, 8, 10});
  CHECK(NiceTicks(1, 10000, 6, true) == std::vector<double>{1, 10, 100, 1000, 10000});
  CHECK(NiceTicks(3, 60, 6, true) == std::vector<double>{5, 10, 20, 50});
  for (const double low : {-3.7, 0.0, 1e-9, 123456.0}) {
    for (const double range : {1e-6, 0.3, 7.0, 1e8}) {
      const auto ticks = NiceTicks(low, low + range, 6, false);
      CHECK(ticks.size() >= 3);
      CHECK(ticks.size() <= 13);
      CHECK(ticks.front() >= low - 1e-6 * range);
      CHECK(ticks.back() <= low + range * (1 + 1e-6));
    }
  }
  CHECK(NiceTicks(40, 60, 5, true).size() >= 3);
}

TEST_CASE("a chart is well formed, with one path a line, and its text escaped") {
  LineChart chart;
  chart.title = "PSNR & <time> \"now\"";
  chart.x_label = "seconds";
  chart.y_label = "dB";
  chart.log_x = true;
  chart.series = {{"fast & small", {{1, 20}, {10, 25}, {100, 31}}, false},
                  {"paper's", {{2, 12}, {20, 18}}, false},
                  {"", {{5, 15}, {6, 16}}, true}};
  const std::string svg = ToSvg(chart);
  CHECK(MarkupProblem(svg) == "");
  CHECK(Count(svg, "stroke-linejoin") == 2);
  CHECK(Count(svg, "<circle") == 2);
  CHECK(svg.find("PSNR &amp; &lt;time&gt; &quot;now&quot;") != std::string::npos);
  CHECK(svg.find("fast &amp; small") != std::string::npos);
  CHECK(svg.find("nan") == std::string::npos);
}

TEST_CASE("points that cannot be shown interrupt the line and nothing else") {
  const double nan = std::numeric_limits<double>::quiet_NaN(), infinity = std::numeric_limits<double>::infinity();
  LineChart chart;
  chart.series = {{"a", {{0, 1}, {1, nan}, {2, 3}, {3, 4}, {infinity, 5}, {5, 6}}, false}};
  const std::string svg = ToSvg(chart);
  CHECK(MarkupProblem(svg) == "");
  CHECK(svg.find("nan") == std::string::npos);
  CHECK(svg.find("inf") == std::string::npos);
  CHECK(Count(svg, "<circle") == 2);  // the two points that stand alone
}

TEST_CASE("charts of nothing, of one point and of a constant are drawn") {
  LineChart chart;
  CHECK(MarkupProblem(ToSvg(chart)) == "");
  CHECK(ToSvg(chart).find("no data") != std::string::npos);
  for (const bool is_log : {false, true}) {
    chart.log_x = chart.log_y = is_log;
    for (const double value : {0.0, 5.0, -3.0, 1e-30, 1e30}) {
      chart.series = {{"one", {{value, value}}, false}, {"flat", {{1, value}, {2, value}}, false}};
      const std::string svg = ToSvg(chart);
      CHECK(MarkupProblem(svg) == "");
      CHECK(svg.find("nan") == std::string::npos);
    }
  }
  chart.width = 100;
  CHECK_THROWS_AS(ToSvg(chart), Error);
}
