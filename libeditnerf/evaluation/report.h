// The report of a run: one HTML file that needs nothing else. Styles, charts and pictures are inside; it adapts to
// narrow windows and to light and dark settings, prints, and has no scripts.
#pragma once

#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "libeditnerf/evaluation/line_chart.h"

namespace editnerf {

struct ReportStage {
  std::string name;               // "Pretraining"
  std::optional<double> seconds;  // empty: not run in this report's run
  std::string state;              // "done", "skipped: already there", "failed: ...": free text
};

struct ReportTable {
  std::string title;
  std::vector<std::string> headers;
  std::vector<std::vector<std::string>> rows;  // cells that read as numbers are aligned to the right
};

struct ReportPicture {
  std::string caption;
  std::string png;       // the file's bytes
  bool is_wide = false;  // over the whole width: a strip of pictures
};

// Given by its bytes, or by its path relative to the report where it is too large to be carried along.
struct ReportVideo {
  std::string caption;
  std::string mp4;
  std::string relative_path;
};

// What was left out or went wrong, with the evidence: "no warp field: the poses are exact (0.01 px)".
struct ReportNote {
  bool is_warning = false;
  std::string text;
};

// Every part is optional; parts without content get no heading.
struct ReportContents {
  std::string title;
  std::string subtitle;                                    // scene, date, machine, version: one line
  std::vector<std::pair<std::string, std::string>> facts;  // shown large: {"PSNR, unseen edits", "31.2 dB"}
  std::vector<ReportNote> notes;
  std::vector<ReportVideo> videos;
  std::vector<ReportPicture> pictures;
  std::vector<LineChart> charts;
  std::vector<ReportTable> tables;
  std::vector<ReportStage> stages;
};

// All texts are escaped here. Throws Error at a picture that is not a PNG, a video with neither bytes nor path, and a
// table row whose length is not that of the headers.
std::string ToHtml(const ReportContents& contents);

std::string EncodeBase64(const std::string& bytes);

std::string SpokenDuration(double seconds);  // "0.4 s", "42 s", "3 min 20 s", "2 h 5 min"; "-" if not finite

}  // namespace editnerf
