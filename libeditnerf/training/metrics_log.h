// Error against run time: one CSV row per measurement while training.
//
//   seconds_training,seconds_total,step,rays,samples,loss.NAME...,held_out_psnr
//
// Numbers have as many digits as reading them back exactly takes; a cell is empty where a value was not measured.
#pragma once

#include <cstdint>
#include <filesystem>
#include <fstream>
#include <map>
#include <optional>
#include <string>
#include <vector>

namespace editnerf {

struct MetricsRow {
  double seconds_training = 0;           // spent in training steps, over all sessions of the run
  double seconds_total = 0;              // with evaluation, checkpoints and start-up
  int64_t step = 0;                      // steps done
  int64_t rays = 0;                      // rays trained on so far
  int64_t samples = 0;                   // field evaluations so far
  std::map<std::string, double> losses;  // by term; a term may be missing
  std::optional<double> held_out_psnr;   // dB
};

class MetricsLog {
 public:
  // Starts the file with a column for each loss term, or, with `resume_step`, keeps the rows of an existing file up to
  // that step (a missing file counts as empty); the columns are then those of the file and the new ones. Throws
  // DataError when the file cannot be read or written, Error at a term whose name has a comma, a quote or a line break.
  MetricsLog(const std::filesystem::path& path, const std::vector<std::string>& loss_terms,
             std::optional<int64_t> resume_step = std::nullopt);

  // The row is on its way to the disk when this returns. Throws Error at a loss term without a column, DataError when
  // the disk is full.
  void Append(const MetricsRow& row);

  const std::vector<std::string>& loss_terms() const { return loss_terms_; }

 private:
  std::string path_;
  std::vector<std::string> loss_terms_;
  std::ofstream stream_;
};

// All rows, in file order. A last line without its end, as a crash leaves it, is ignored, and so are columns of unknown
// name. Throws DataError naming file and line at a missing column or a cell that is not a number.
std::vector<MetricsRow> ReadMetricsLog(const std::filesystem::path& path);

}  // namespace editnerf
