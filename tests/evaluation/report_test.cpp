#include "libeditnerf/evaluation/report.h"

#include <limits>

#include "libeditnerf/base/error.h"
#include "tests/catch.h"
#include "tests/evaluation/markup_check.h"
#include "tests/pickle_writer.h"

using namespace editnerf;
using editnerf::testing::MarkupProblem;

namespace {

// One blue pixel.
const std::string kPng(
    "\211\120\116\107\015\012\032\012\000\000\000\015\111\110\104\122\000\000\000\001\000\000\000\001"
    "\010\002\000\000\000\220\167\123\336\000\000\000\014\111\104\101\124\170\234\143\010\150\070\000"
    "\000\002\264\001\221\124\060\063\022\000\000\000\000\111\105\116\104\256\102\140\202",
    69);

ReportContents FullReport() {
  ReportContents contents;
  contents.title = "Lid & <hinge>";
  contents.subtitle = "scene data/lid, 160 training frames";
  contents.facts = {
      {"PSNR, unseen edits", "31.2 dB"}, {"Key points", "1"}, {"Render time", "0.4 s"}, {"Training", "5 min"}};
  contents.notes = {{false, "No warp field: the poses are exact (0.01 px)."},
                    {true, "Key point 1 hardly moves <0.002>."}};
  contents.pictures = {{"A \"quoted\" caption", kPng, false}, {"Truth", kPng, false}, {"Strip", kPng, true}};
  contents.videos = {{"Edited", "", "edited & final.mp4"}, {"Small", "mp4 bytes", ""}};
  LineChart chart;
  chart.title = "Held-out PSNR";
  chart.x_label = "training seconds";
  chart.y_label = "dB";
  chart.log_x = true;
  chart.series = {{"fast", {{5, 18}, {10, 21}, {20, 24.5}, {40, 27}, {80, 28.9}, {160, 30.2}, {320, 31.1}}, false},
                  {"paper", {{20, 12}, {80, 15.5}, {320, 19.7}}, false}};
  contents.charts = {chart};
  contents.tables = {
      {"Scores", {"Protocol", "PSNR", "LPIPS"}, {{"editing", "31.20 dB", "0.08"}, {"baseline", "18.4 dB", ""}}}};
  contents.stages = {{"Poses", 12.5, "done"}, {"Training", 4000, "done"}, {"Evaluation", std::nullopt, "skipped"}};
  return contents;
}

}  // namespace

TEST_CASE("base64 has the standard's values") {
  CHECK(EncodeBase64("") == "");
  CHECK(EncodeBase64("f") == "Zg==");
  CHECK(EncodeBase64("fo") == "Zm8=");
  CHECK(EncodeBase64("foo") == "Zm9v");
  CHECK(EncodeBase64("foobar") == "Zm9vYmFy");
  CHECK(EncodeBase64(std::string("\xff\x00\xfe", 3)) == "/wD+");
}

TEST_CASE("durations are written in units that people read") {
  CHECK(SpokenDuration(0.42) == "0.4 s");
  CHECK(SpokenDuration(9.96) == "10 s");
  CHECK(SpokenDuration(59.4) == "59 s");
  CHECK(SpokenDuration(59.6) == "1 min 0 s");
  CHECK(SpokenDuration(200) == "3 min 20 s");
  CHECK(SpokenDuration(7500) == "2 h 5 min");
  CHECK(SpokenDuration(std::numeric_limits<double>::quiet_NaN()) == "-");
}

TEST_CASE("a report is well formed and refers to nothing outside but its videos") {
  const std::string html = ToHtml(FullReport());
  editnerf::testing::Scratch("report.html", html);
  CHECK(MarkupProblem(html) == "");
  CHECK(html.find("Lid &amp; &lt;hinge&gt;") != std::string::npos);
  CHECK(html.find("<hinge>") == std::string::npos);
  CHECK(html.find("data:image/png;base64,iVBORw0KGgo") != std::string::npos);
  CHECK(html.find("<figure class=\"wide\"><img alt=\"Strip\"") != std::string::npos);
  CHECK(html.find("src=\"edited &amp; final.mp4\"") != std::string::npos);
  CHECK(html.find("data:video/mp4;base64,bXA0IGJ5dGVz") != std::string::npos);
  CHECK(html.find("<td class=\"number\">31.20 dB</td>") != std::string::npos);
  CHECK(html.find("<td>editing</td>") != std::string::npos);
  CHECK(html.find("1 h 6 min") != std::string::npos);
  CHECK(html.find("<script") == std::string::npos);
  CHECK(html.find("https:") == std::string::npos);
  CHECK(html.find("url(") == std::string::npos);
}

TEST_CASE("a report without contents has no empty headings") {
  ReportContents contents;
  contents.title = "Nothing yet";
  const std::string html = ToHtml(contents);
  CHECK(MarkupProblem(html) == "");
  CHECK(html.find("<h2>") == std::string::npos);
}

TEST_CASE("a report names the part that is wrong") {
  auto contents = FullReport();
  contents.pictures[1].png = "JPEG";
  CHECK_THROWS_WITH(ToHtml(contents), "report: picture 'Truth' is not a PNG");
  contents = FullReport();
  contents.videos[0].relative_path.clear();
  CHECK_THROWS_WITH(ToHtml(contents), "report: video 'Edited' has neither bytes nor a path");
  contents = FullReport();
  contents.tables[0].rows[1].pop_back();
  CHECK_THROWS_WITH(ToHtml(contents), "report: table 'Scores': a row of 2 cells, expected 3");
}
