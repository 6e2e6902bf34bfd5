#include "libeditnerf/training/metrics_log.h"

#include <algorithm>
#include <charconv>
#include <string_view>

#include "libeditnerf/base/error.h"
#include "libeditnerf/base/file.h"

namespace editnerf {
namespace {

constexpr std::string_view kLossPrefix = "loss.";
constexpr const char* kPsnrColumn = "held_out_psnr";
const char* const kLeadingColumns[] = {"seconds_training", "seconds_total", "step", "rays", "samples"};

std::vector<std::string_view> Cells(std::string_view line) {
  std::vector<std::string_view> cells;
  for (size_t begin = 0;;) {
    const size_t comma = line.find(',', begin);
    cells.push_back(line.substr(begin, comma == std::string_view::npos ? comma : comma - begin));
    if (comma == std::string_view::npos) return cells;
    begin = comma + 1;
  }
}

// Complete lines; what follows the last line break was cut off by a crash.
std::vector<std::string_view> Lines(std::string_view content) {
  std::vector<std::string_view> lines;
  for (size_t end = content.find('\n'); end != std::string_view::npos; end = content.find('\n')) {
    std::string_view line = content.substr(0, end);
    if (!line.empty() && line.back() == '\r') line.remove_suffix(1);
    lines.push_back(line);
    content.remove_prefix(end + 1);
  }
  return lines;
}

std::string Header(const std::vector<std::string>& loss_terms) {
  std::string header;
  for (const char* column : kLeadingColumns) header += fmt::format("{},", column);
  for (const auto& term : loss_terms) header += fmt::format("{}{},", kLossPrefix, term);
  return header + kPsnrColumn + "\n";
}

std::string Line(const MetricsRow& row, const std::vector<std::string>& loss_terms) {
  std::string line =
      fmt::format("{},{},{},{},{},", row.seconds_training, row.seconds_total, row.step, row.rays, row.samples);
  for (const auto& term : loss_terms) {
    const auto loss = row.losses.find(term);
    line += loss == row.losses.end() ? "," : fmt::format("{},", loss->second);
  }
  if (row.held_out_psnr) line += fmt::format("{}", *row.held_out_psnr);
  return line + "\n";
}

class TableReader {
 public:
  TableReader(const std::string& content, const std::string& path) : lines_(Lines(content)), path_(path) {
    if (lines_.empty()) Throw<DataError>("{}: empty, expected a header", path_);
    columns_ = Cells(lines_[0]);
  }

  size_t num_lines() const { return lines_.size(); }
  const std::vector<std::string_view>& columns() const { return columns_; }

  size_t Column(std::string_view name) const {
    const auto found = std::find(columns_.begin(), columns_.end(), name);
    if (found == columns_.end()) Throw<DataError>("{}:1: no column '{}'", path_, name);
    return static_cast<size_t>(found - columns_.begin());
  }

  std::vector<std::string_view> Row(size_t line) const {
    auto cells = Cells(lines_[line]);
    if (cells.size() != columns_.size()) {
      Throw<DataError>("{}:{}: found {} cells, expected {}", path_, line + 1, cells.size(), columns_.size());
    }
    return cells;
  }

  template <class T>
  T Number(std::string_view cell, size_t line) const {
    T value{};
    const auto [end, error] = std::from_chars(cell.data(), cell.data() + cell.size(), value);
    if (error != std::errc() || end != cell.data() + cell.size()) {
      Throw<DataError>("{}:{}: found '{}', expected a number", path_, line + 1, cell);
    }
    return value;
  }

 private:
  std::vector<std::string_view> lines_;
  std::string path_;
  std::vector<std::string_view> columns_;
};

}  // namespace

MetricsLog::MetricsLog(const std::filesystem::path& path, const std::vector<std::string>& loss_terms,
                       std::optional<int64_t> resume_step)
    : path_(path.string()) {
  std::vector<MetricsRow> rows;
  if (resume_step && std::filesystem::exists(path)) rows = ReadMetricsLog(path);
  rows.erase(std::remove_if(rows.begin(), rows.end(), [&](const MetricsRow& row) { return row.step > *resume_step; }),
             rows.end());

  loss_terms_ = loss_terms;
  for (const MetricsRow& row : rows) {
    for (const auto& [term, value] : row.losses) {
      if (std::find(loss_terms_.begin(), loss_terms_.end(), term) == loss_terms_.end()) loss_terms_.push_back(term);
    }
  }
  for (const auto& term : loss_terms_) {
    if (term.find_first_of(",\"\r\n") != std::string::npos) {
      Throw<Error>("{}: a loss term called '{}' cannot head a column", path_, term);
    }
  }
  std::string content = Header(loss_terms_);
  for (const MetricsRow& row : rows) content += Line(row, loss_terms_);
  WriteFileAtomically(path, content);
  stream_.open(path, std::ios::app | std::ios::binary);
  if (!stream_) Throw<DataError>("{}: cannot be opened for appending", path_);
}

void MetricsLog::Append(const MetricsRow& row) {
  for (const auto& [term, value] : row.losses) {
    if (std::find(loss_terms_.begin(), loss_terms_.end(), term) == loss_terms_.end()) {
      Throw<Error>("{}: no column for the loss term '{}'", path_, term);
    }
  }
  stream_ << Line(row, loss_terms_) << std::flush;
  if (!stream_) Throw<DataError>("{}: cannot be written: is the disk full?", path_);
}

std::vector<MetricsRow> ReadMetricsLog(const std::filesystem::path& path) {
  const std::string content = ReadFile(path);
  const TableReader table(content, path.string());
  const size_t training = table.Column("seconds_training"), total = table.Column("seconds_total");
  const size_t step = table.Column("step"), rays = table.Column("rays"), samples = table.Column("samples");
  const size_t psnr = table.Column(kPsnrColumn);

  std::vector<MetricsRow> rows;
  for (size_t line = 1; line < table.num_lines(); ++line) {
    const auto cells = table.Row(line);
    MetricsRow row;
    row.seconds_training = table.Number<double>(cells[training], line);
    row.seconds_total = table.Number<double>(cells[total], line);
    row.step = table.Number<int64_t>(cells[step], line);
    row.rays = table.Number<int64_t>(cells[rays], line);
    row.samples = table.Number<int64_t>(cells[samples], line);
    if (!cells[psnr].empty()) row.held_out_psnr = table.Number<double>(cells[psnr], line);
    for (size_t i = 0; i < cells.size(); ++i) {
      const std::string_view column = table.columns()[i];
      if (column.substr(0, kLossPrefix.size()) != kLossPrefix || cells[i].empty()) continue;
      row.losses[std::string(column.substr(kLossPrefix.size()))] = table.Number<double>(cells[i], line);
    }
    rows.push_back(std::move(row));
  }
  return rows;
}

}  // namespace editnerf
