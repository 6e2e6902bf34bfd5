#include "libeditnerf/evaluation/report.h"

#include <algorithm>
#include <cctype>
#include <cmath>
#include <cstdint>

#include "libeditnerf/base/error.h"

namespace editnerf {
namespace {

constexpr const char* kStyle = R"css(
:root { color-scheme: light dark; --ink: #1d232b; --soft: #5c6672; --page: #f6f7f9; --card: #ffffff; --line: #dfe3e8;
        --accent: #2f6fc4; --warn: #9a5b00; --warn-page: #fff4e0; }
@media (prefers-color-scheme: dark) {
  :root { --ink: #e6e9ed; --soft: #9aa5b1; --page: #14171b; --card: #1d2126; --line: #333a42;
          --accent: #79aef2; --warn: #f0b760; --warn-page: #33270f; } }
* { box-sizing: border-box; }
body { margin: 0; background: var(--page); color: var(--ink); line-height: 1.5;
       font-family: system-ui, -apple-system, "Segoe UI", Roboto, "Helvetica Neue", sans-serif; }
main { max-width: 1080px; margin: 0 auto; padding: 2.5rem 1.25rem 4rem; }
h1 { font-size: 1.9rem; line-height: 1.2; margin: 0; letter-spacing: -0.01em; overflow-wrap: anywhere; }
h2 { font-size: 1.2rem; margin: 2.75rem 0 0.9rem; }
h3 { font-size: 1rem; margin: 1.5rem 0 0.5rem; }
.subtitle { color: var(--soft); margin: 0.35rem 0 0; overflow-wrap: anywhere; }
.facts { display: grid; grid-template-columns: repeat(auto-fit, minmax(160px, 1fr)); gap: 0.75rem; margin: 1.75rem 0 0; }
.facts div, .card { background: var(--card); border: 1px solid var(--line); border-radius: 10px; padding: 0.9rem 1rem; }
.facts dt { color: var(--soft); font-size: 0.85rem; }
.facts dd { margin: 0.1rem 0 0; font-size: 1.35rem; font-weight: 600; overflow-wrap: anywhere; }
.notes { list-style: none; padding: 0; margin: 0; }
.notes li { border-left: 4px solid var(--accent); background: var(--card); border-radius: 0 8px 8px 0; padding: 0.6rem 0.9rem;
            margin: 0.5rem 0; overflow-wrap: anywhere; }
.notes .warning { border-color: var(--warn); background: var(--warn-page); }
.notes strong { color: var(--warn); }
.gallery { display: grid; grid-template-columns: repeat(auto-fit, minmax(min(100%, 320px), 1fr)); gap: 1rem; }
.gallery figure { margin: 0; background: var(--card); border: 1px solid var(--line); border-radius: 10px; overflow: hidden; }
.gallery .wide { grid-column: 1 / -1; }
.gallery img, .gallery video { display: block; width: 100%; height: auto; }
figcaption { padding: 0.6rem 0.9rem; color: var(--soft); font-size: 0.92rem; }
.card + .card { margin-top: 1rem; }
.card svg { display: block; margin: 0 auto; }
.scroll { overflow-x: auto; }
table { border-collapse: collapse; width: 100%; font-size: 0.95rem; font-variant-numeric: tabular-nums; }
th, td { text-align: left; padding: 0.45rem 0.75rem; border-bottom: 1px solid var(--line); }
th { color: var(--soft); font-weight: 600; font-size: 0.85rem; }
tr:last-child td { border-bottom: 0; }
.number { text-align: right; white-space: nowrap; }
.total td { font-weight: 600; }
@media print { body { background: none; } figure, .card, .facts div { break-inside: avoid; } }
)css";

constexpr char kPngSignature[] = "\x89PNG\r\n\x1a\n";

// "31.2", "-0.5", "31.2 dB", "95 %": a number with at most one short unit.
bool ReadsAsNumber(const std::string& cell) {
  size_t at = 0;
  size_t num_digits = 0;
  while (at < cell.size() && (std::isdigit(static_cast<unsigned char>(cell[at])) != 0 ||
                              std::string("+-.,eE").find(cell[at]) != std::string::npos)) {
    num_digits += std::isdigit(static_cast<unsigned char>(cell[at])) != 0 ? 1 : 0;
    ++at;
  }
  return cell == "-" || (num_digits > 0 && cell.size() - at <= 4 && cell.find(' ', at + 1) == std::string::npos);
}

std::string Cell(const char* tag, const std::string& text, bool is_number) {
  return fmt::format("<{0}{1}>{2}</{0}>", tag, is_number ? " class=\"number\"" : "", EscapeMarkup(text));
}

std::string Facts(const ReportContents& contents) {
  if (contents.facts.empty()) return "";
  std::string html = "<dl class=\"facts\">\n";
  for (const auto& [key, value] : contents.facts) {
    html += fmt::format("<div><dt>{}</dt><dd>{}</dd></div>\n", EscapeMarkup(key), EscapeMarkup(value));
  }
  return html + "</dl>\n";
}

std::string Notes(const ReportContents& contents) {
  if (contents.notes.empty()) return "";
  std::string html = "<h2>Good to know</h2>\n<ul class=\"notes\">\n";
  for (const ReportNote& note : contents.notes) {
    html += fmt::format("<li{}>{}{}</li>\n", note.is_warning ? " class=\"warning\"" : "",
                        note.is_warning ? "<strong>Warning:</strong> " : "", EscapeMarkup(note.text));
  }
  return html + "</ul>\n";
}

std::string Videos(const ReportContents& contents) {
  if (contents.videos.empty()) return "";
  std::string html = "<h2>Videos</h2>\n<div class=\"gallery\">\n";
  for (const ReportVideo& video : contents.videos) {
    if (video.mp4.empty() && video.relative_path.empty()) {
      Throw<Error>("report: video '{}' has neither bytes nor a path", video.caption);
    }
    const std::string source =
        video.mp4.empty() ? EscapeMarkup(video.relative_path) : "data:video/mp4;base64," + EncodeBase64(video.mp4);
    html += fmt::format(
        "<figure><video controls loop muted playsinline src=\"{}\"></video><figcaption>{}</figcaption></figure>\n",
        source, EscapeMarkup(video.caption));
  }
  return html + "</div>\n";
}

std::string Pictures(const ReportContents& contents) {
  if (contents.pictures.empty()) return "";
  std::string html = "<h2>Pictures</h2>\n<div class=\"gallery\">\n";
  for (const ReportPicture& picture : contents.pictures) {
    if (picture.png.compare(0, 8, kPngSignature, 8) != 0)
      Throw<Error>("report: picture '{}' is not a PNG", picture.caption);
    const std::string caption = EscapeMarkup(picture.caption);
    html += fmt::format(
        "<figure{2}><img alt=\"{0}\" src=\"data:image/png;base64,{1}\"><figcaption>{0}</figcaption></figure>\n",
        caption, EncodeBase64(picture.png), picture.is_wide ? " class=\"wide\"" : "");
  }
  return html + "</div>\n";
}

std::string Charts(const ReportContents& contents) {
  if (contents.charts.empty()) return "";
  std::string html = "<h2>Error against run time</h2>\n";
  for (const LineChart& chart : contents.charts) html += "<div class=\"card\">\n" + ToSvg(chart) + "</div>\n";
  return html;
}

std::string Tables(const ReportContents& contents) {
  if (contents.tables.empty()) return "";
  std::string html = "<h2>Measurements</h2>\n";
  for (const ReportTable& table : contents.tables) {
    std::vector<bool> is_number(table.headers.size(), !table.rows.empty());
    for (const auto& row : table.rows) {
      if (row.size() != table.headers.size()) {
        Throw<Error>("report: table '{}': a row of {} cells, expected {}", table.title, row.size(),
                     table.headers.size());
      }
      for (size_t i = 0; i < row.size(); ++i) is_number[i] = is_number[i] && (row[i].empty() || ReadsAsNumber(row[i]));
    }
    html += fmt::format("<h3>{}</h3>\n<div class=\"card scroll\"><table>\n<tr>", EscapeMarkup(table.title));
    for (size_t i = 0; i < table.headers.size(); ++i) html += Cell("th", table.headers[i], is_number[i]);
    html += "</tr>\n";
    for (const auto& row : table.rows) {
      html += "<tr>";
      for (size_t i = 0; i < row.size(); ++i) html += Cell("td", row[i], is_number[i]);
      html += "</tr>\n";
    }
    html += "</table></div>\n";
  }
  return html;
}

std::string Stages(const ReportContents& contents) {
  if (contents.stages.empty()) return "";
  std::string html = "<h2>Stages</h2>\n<div class=\"card scroll\"><table>\n<tr>" + Cell("th", "Stage", false) +
                     Cell("th", "State", false) + Cell("th", "Time", true) + "</tr>\n";
  double total = 0;
  for (const ReportStage& stage : contents.stages) {
    total += stage.seconds.value_or(0);
    html += "<tr>" + Cell("td", stage.name, false) + Cell("td", stage.state, false) +
            Cell("td", stage.seconds ? SpokenDuration(*stage.seconds) : "", true) + "</tr>\n";
  }
  return html + "<tr class=\"total\">" + Cell("td", "Together", false) + Cell("td", "", false) +
         Cell("td", SpokenDuration(total), true) + "</tr>\n</table></div>\n";
}

}  // namespace

std::string EncodeBase64(const std::string& bytes) {
  static constexpr char kDigits[] = "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
  std::string encoded;
  encoded.reserve((bytes.size() + 2) / 3 * 4);
  for (size_t i = 0; i < bytes.size(); i += 3) {
    uint32_t group = 0;
    const size_t count = std::min<size_t>(3, bytes.size() - i);
    for (size_t k = 0; k < 3; ++k) group = group << 8 | (k < count ? static_cast<unsigned char>(bytes[i + k]) : 0u);
    for (size_t k = 0; k < 4; ++k) encoded += k <= count ? kDigits[group >> (18 - 6 * k) & 63] : '=';
  }
  return encoded;
}

std::string SpokenDuration(double seconds) {
  if (!std::isfinite(seconds)) return "-";
  if (seconds < 9.95) return fmt::format("{:.1f} s", seconds);
  const auto whole = static_cast<int64_t>(std::llround(seconds));
  if (whole < 60) return fmt::format("{} s", whole);
  if (whole < 3600) return fmt::format("{} min {} s", whole / 60, whole % 60);
  return fmt::format("{} h {} min", whole / 3600, whole % 3600 / 60);
}

std::string ToHtml(const ReportContents& contents) {
  const std::string title = EscapeMarkup(contents.title);
  std::string html =
      "<!DOCTYPE html>\n<html lang=\"en\">\n<head>\n<meta charset=\"utf-8\">\n"
      "<meta name=\"viewport\" content=\"width=device-width, initial-scale=1\">\n";
  html +=
      fmt::format("<title>{}</title>\n<style>{}</style>\n</head>\n<body>\n<main>\n<h1>{}</h1>\n", title, kStyle, title);
  if (!contents.subtitle.empty())
    html += fmt::format("<p class=\"subtitle\">{}</p>\n", EscapeMarkup(contents.subtitle));
  html += Facts(contents) + Videos(contents) + Pictures(contents) + Notes(contents) + Charts(contents) +
          Tables(contents) + Stages(contents);
  return html + "</main>\n</body>\n</html>\n";
}

}  // namespace editnerf
