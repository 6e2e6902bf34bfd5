#include "libeditnerf/imaging/key_point_files.h"

#include <algorithm>
#include <charconv>
#include <cmath>
#include <functional>

#include "libeditnerf/base/error.h"
#include "libeditnerf/base/file.h"
#include "libeditnerf/base/shape.h"
#include "libeditnerf/imaging/npy_file.h"

namespace editnerf {
namespace fs = std::filesystem;
namespace {

constexpr uintmax_t kMaxTextBytes = uintmax_t{1} << 28;

fs::path TracksPath(const fs::path& folder) { return folder / "data" / "k_points_auto.txt"; }
fs::path LocalPath(const fs::path& folder, int64_t index) {
  return folder / "data" / ("k_points_auto_coor_" + std::to_string(index) + ".txt");
}
fs::path DepthPath(const fs::path& folder, const std::string& id) {
  return folder / "depth" / ("depth_median_" + id + ".npy");
}
fs::path FlowPath(const fs::path& folder, const std::string& id) { return folder / "flow" / ("flow_" + id + ".npy"); }

// Rows of finite numbers separated by blanks or commas; empty lines are skipped.
std::vector<std::vector<double>> ReadRows(const fs::path& path) {
  const std::string text = ReadFile(path, kMaxTextBytes);
  std::vector<std::vector<double>> rows(1);
  const char* at = text.data();
  const char* end = at + text.size();
  while (at != end) {
    if (*at == '\n') {
      if (!rows.back().empty()) rows.emplace_back();
      ++at;
    } else if (*at == ' ' || *at == '\t' || *at == '\r' || *at == ',') {
      ++at;
    } else {
      double value = 0;
      const auto [next, error] = std::from_chars(at, end, value);
      if (error != std::errc() || !std::isfinite(value)) {
        Throw<DataError>("{}: row {}: expected finite numbers, found '{}'", path.string(), rows.size(),
                         std::string(at, std::min<size_t>(12, static_cast<size_t>(end - at))));
      }
      rows.back().push_back(value);
      at = next;
    }
  }
  if (rows.back().empty()) rows.pop_back();
  return rows;
}

std::string Row(const torch::Tensor& values) {
  const torch::Tensor flat = values.reshape({-1});
  std::string row;
  for (int64_t i = 0; i < flat.numel(); ++i) row += fmt::format("{}{:.17g}", i > 0 ? " " : "", flat[i].item<double>());
  return row + "\n";
}

torch::Tensor ReadChecked(const fs::path& path, int64_t dimensions, const char* expected) {
  const torch::Tensor array = ReadNpy(path);
  if (array.dim() != dimensions || !array.is_floating_point() || (dimensions == 3 && array.size(2) != 2)) {
    Throw<DataError>("{}: expected {} floating point numbers, found {}", path.string(), expected, ShapeString(array));
  }
  return array.to(torch::kFloat32);
}

torch::Tensor Stack(const std::vector<std::string>& ids, const std::function<fs::path(const std::string&)>& path_of,
                    const std::function<torch::Tensor(const std::string&)>& read) {
  std::vector<torch::Tensor> arrays;
  for (const std::string& id : ids) {
    arrays.push_back(read(id));
    if (arrays.back().sizes() != arrays.front().sizes()) {
      Throw<DataError>("{}: {}, expected {} as in {}", path_of(id).string(), ShapeString(arrays.back()),
                       ShapeString(arrays.front()), path_of(ids.front()).filename().string());
    }
  }
  if (arrays.empty()) Throw<ShapeError>("expected at least one frame to read");
  return torch::stack(arrays);
}

}  // namespace

torch::Tensor KeyPointFiles::InSceneUnits() const { return (local - offset) / scale.unsqueeze(-1); }

bool HasKeyPointFiles(const fs::path& folder) { return fs::exists(TracksPath(folder)); }

KeyPointFiles ReadKeyPointFiles(const fs::path& folder) {
  const fs::path path = TracksPath(folder);
  const auto rows = ReadRows(path);
  if (rows.empty() || rows[0].size() % 3 != 0) {
    Throw<DataError>("{}: expected rows of 3 N numbers, found {} in the first", path.string(),
                     rows.empty() ? 0 : rows[0].size());
  }
  const auto num_frames = static_cast<int64_t>(rows.size()), num_points = static_cast<int64_t>(rows[0].size() / 3);
  KeyPointFiles files;
  files.local = torch::empty({num_frames, num_points, 3}, torch::kFloat64);
  auto* out = files.local.data_ptr<double>();
  for (size_t t = 0; t < rows.size(); ++t) {
    if (rows[t].size() != rows[0].size()) {
      Throw<DataError>("{}: row {} holds {} numbers, expected {} as in the first", path.string(), t + 1, rows[t].size(),
                       rows[0].size());
    }
    out = std::copy(rows[t].begin(), rows[t].end(), out);
  }
  files.scale = torch::empty({num_points}, torch::kFloat64);
  files.offset = torch::empty({num_points, 3}, torch::kFloat64);
  const bool from_one = !fs::exists(LocalPath(folder, 0)) && fs::exists(LocalPath(folder, num_points));
  for (int64_t i = 0; i < num_points; ++i) {
    const fs::path local_path = LocalPath(folder, from_one ? i + 1 : i);
    std::vector<double> numbers;
    for (const auto& row : ReadRows(local_path)) numbers.insert(numbers.end(), row.begin(), row.end());
    if (numbers.size() != 4) {
      Throw<DataError>("{}: expected 4 numbers, the scale and 3 offsets, found {}", local_path.string(),
                       numbers.size());
    }
    if (!(numbers[0] > 0)) {
      Throw<DataError>("{}: expected a positive scale, found {}", local_path.string(), numbers[0]);
    }
    files.scale[i] = numbers[0];
    for (int64_t axis = 0; axis < 3; ++axis) files.offset[i][axis] = numbers[static_cast<size_t>(axis) + 1];
  }
  return files;
}

void WriteKeyPointFiles(const fs::path& folder, const KeyPointFiles& key_points) {
  CheckShape(key_points.local, {kAny, kAny, 3}, "key points");
  const int64_t num_points = key_points.local.size(1);
  CheckShape(key_points.scale, {num_points}, "key point scales");
  CheckShape(key_points.offset, {num_points, 3}, "key point offsets");
  const torch::Tensor local = key_points.local.detach().to(torch::kCPU, torch::kFloat64);
  const torch::Tensor scale = key_points.scale.detach().to(torch::kCPU, torch::kFloat64);
  const torch::Tensor offset = key_points.offset.detach().to(torch::kCPU, torch::kFloat64);
  MakeFolder(folder / "data");
  for (int64_t i = 0; i < num_points; ++i) {
    WriteFileAtomically(LocalPath(folder, i), Row(torch::cat({scale.slice(0, i, i + 1), offset[i]})));
  }
  // Files of a set with more key points would be taken for this one's.
  for (int64_t i = num_points; fs::exists(LocalPath(folder, i)); ++i) fs::remove(LocalPath(folder, i));
  std::string rows;
  for (int64_t t = 0; t < local.size(0); ++t) rows += Row(local[t]);
  WriteFileAtomically(TracksPath(folder), rows);
}

torch::Tensor ReadMedianDepth(const fs::path& folder, const std::string& id) {
  return ReadChecked(DepthPath(folder, id), 2, "[H, W]");
}

void WriteMedianDepth(const fs::path& folder, const std::string& id, const torch::Tensor& depth) {
  CheckShape(depth, {kAny, kAny}, "median depth");
  MakeFolder(folder / "depth");
  WriteNpy(DepthPath(folder, id), depth.to(torch::kFloat32));
}

torch::Tensor ReadFlow(const fs::path& folder, const std::string& id) {
  return ReadChecked(FlowPath(folder, id), 3, "[H, W, 2]");
}

void WriteFlow(const fs::path& folder, const std::string& id, const torch::Tensor& flow) {
  CheckShape(flow, {kAny, kAny, 2}, "flow");
  MakeFolder(folder / "flow");
  WriteNpy(FlowPath(folder, id), flow.to(torch::kFloat32));
}

torch::Tensor ReadMedianDepths(const fs::path& folder, const std::vector<std::string>& ids) {
  return Stack(
      ids, [&](const std::string& id) { return DepthPath(folder, id); },
      [&](const std::string& id) { return ReadMedianDepth(folder, id); });
}

torch::Tensor ReadFlows(const fs::path& folder, const std::vector<std::string>& ids) {
  const std::vector<std::string> all_but_last(ids.begin(), ids.empty() ? ids.end() : ids.end() - 1);
  return Stack(
      all_but_last, [&](const std::string& id) { return FlowPath(folder, id); },
      [&](const std::string& id) { return ReadFlow(folder, id); });
}

}  // namespace editnerf
