#include "libeditnerf/benchmarks/tables_layout.h"

#include <fmt/format.h>

#include <algorithm>
#include <numeric>
#include <set>

namespace editnerf {
namespace {

struct Column {
  const char* title;
  const char* key;  // of the scores
  int digits;
  double factor = 1;
};

const Json* Find(const Json& object, const std::string& key) {
  const auto found = object.find(key);
  return found == object.end() || found->is_null() ? nullptr : &*found;
}

// What every seed's row `name` has under `key`.
std::vector<Json> Collect(const Json& scene, const std::string& name, const std::string& key, double factor) {
  std::vector<Json> values;
  for (const Json& seed : scene.at("seeds")) {
    const Json* const row = Find(seed.at("rows"), name);
    const Json* const value = row == nullptr ? nullptr : Find(*row, key);
    if (value != nullptr && value->is_number()) values.push_back(value->get<double>() * factor);
  }
  return values;
}

std::vector<std::string> Cells(const Json& scene, const std::string& row, const std::vector<Column>& columns) {
  std::vector<std::string> cells;
  for (const Column& column : columns) {
    cells.push_back(MeanAndRange(Collect(scene, row, column.key, column.factor), column.digits));
  }
  return cells;
}

BenchmarkTable Titled(const std::string& title, const char* what, const std::vector<Column>& columns) {
  BenchmarkTable table{title, {"scene", what}, {}};
  for (const Column& column : columns) table.headers.emplace_back(column.title);
  return table;
}

void AddRow(BenchmarkTable* table, const std::string& scene, const std::string& name, std::vector<std::string> cells) {
  cells.insert(cells.begin(), {scene, name});
  table->rows.push_back(std::move(cells));
}

bool HasRow(const Json& scene, const std::string& name) {
  const Json& seeds = scene.at("seeds");
  return std::any_of(seeds.begin(), seeds.end(),
                     [&](const Json& seed) { return Find(seed.at("rows"), name) != nullptr; });
}

BenchmarkTable Fields(const Json& scenes, const std::string& protocol, const std::string& title) {
  const std::string moving = protocol + ".psnr_moving", psnr = protocol + ".psnr", ssim = protocol + ".ssim",
                    ms_ssim = protocol + ".ms_ssim", lpips = protocol + ".lpips";
  const std::vector<Column> columns = {{"PSNR, dB", psnr.c_str(), 2},
                                       {"moving pixels, dB", moving.c_str(), 2},
                                       {"SSIM", ssim.c_str(), 4},
                                       {"MS-SSIM", ms_ssim.c_str(), 4},
                                       {"LPIPS", lpips.c_str(), 4},
                                       {"training, s", "seconds.train_only", 0},
                                       {"pretraining, s", "seconds.pretrain_only", 0}};
  BenchmarkTable table = Titled(title, "field", columns);
  const std::vector<std::pair<const char*, const char*>> fields = {
      {"hypernerf", "HyperNeRF stage, fast field"}, {"fast", "fast field"}, {"paper", "the paper's networks"}};
  for (const Json& scene : scenes) {
    for (const auto& [row, title_of_row] : fields) {
      if (!Collect(scene, row, psnr, 1).empty())
        AddRow(&table, scene.at("name"), title_of_row, Cells(scene, row, columns));
    }
    const std::string baseline = protocol + "_nearest.psnr";
    if (const auto values = Collect(scene, "fast", baseline, 1); !values.empty()) {
      std::vector<std::string> cells(columns.size(), "-");
      cells.front() = MeanAndRange(values, 2);
      AddRow(&table, scene.at("name"), "nearest training image", cells);
    }
  }
  return table;
}

BenchmarkTable Ladder(const Json& scenes) {
  const std::vector<Column> columns = {{"edits, dB", "editing.psnr", 2},
                                       {"moving pixels, dB", "editing.psnr_moving", 2},
                                       {"MS-SSIM", "editing.ms_ssim", 4},
                                       {"LPIPS", "editing.lpips", 4},
                                       {"reconstruction, dB", "reconstruction.psnr", 2},
                                       {"key points off, % of their way", "key_points.error_share", 1, 100},
                                       {"training, s", "seconds.train_only", 0}};
  BenchmarkTable table = Titled("ablation", "step", columns);
  for (const Json& scene : scenes) {
    std::set<std::string> done;
    for (const Json& seed : scene.at("seeds")) {
      for (const Json& step : seed.at("ladder")) {
        const std::string name = step.at("name");
        if (!done.insert(name).second || !HasRow(scene, name)) continue;
        AddRow(&table, scene.at("name"), step.at("description"), Cells(scene, name, columns));
      }
    }
  }
  return table;
}

std::string Percent(const std::vector<Json>& medians, const std::vector<Json>& high) {
  return medians.empty() ? "-" : MeanAndRange(medians, 2) + " / " + MeanAndRange(high, 2);
}

// depth_of(seed): {part: {"median", "percentile90"}} or nullptr.
template <class DepthOf>
std::string DepthCell(const Json& scene, const std::string& part, const DepthOf& depth_of) {
  std::vector<Json> medians, high;
  for (const Json& seed : scene.at("seeds")) {
    const Json* const depth = depth_of(seed);
    const Json* const own = depth == nullptr ? nullptr : Find(*depth, part);
    if (own == nullptr) continue;
    medians.push_back(100 * own->at("median").get<double>());
    high.push_back(100 * own->at("percentile90").get<double>());
  }
  return Percent(medians, high);
}

BenchmarkTable Depth(const Json& scenes) {
  BenchmarkTable table{"depth in training views, median / 90th percentile of the error in per cent",
                       {"scene", "part", "pretrained", "known from tracks", "trained"},
                       {}};
  for (const Json& scene : scenes) {
    const auto row_depth = [](const Json& seed, const char* row) -> const Json* {
      const Json* const scores = Find(seed.at("rows"), row);
      return scores == nullptr ? nullptr : Find(*scores, "depth");
    };
    std::set<std::string> parts;
    for (const Json& seed : scene.at("seeds")) {
      if (const Json* const depth = row_depth(seed, "hypernerf")) {
        for (const auto& item : depth->items()) parts.insert(item.key());
      }
    }
    for (const std::string& part : parts) {
      AddRow(&table, scene.at("name"), part,
             {DepthCell(scene, part, [&](const Json& seed) { return row_depth(seed, "hypernerf"); }),
              DepthCell(scene, part, [&](const Json& seed) { return &seed.at("known_depth"); }),
              DepthCell(scene, part, [&](const Json& seed) { return row_depth(seed, "fast"); })});
    }
  }
  return table;
}

BenchmarkTable KeyPoints(const Json& scenes) {
  BenchmarkTable table{"key points", {"scene", "found on", "off, % of their way: median", "95th percentile"}, {}};
  for (const Json& scene : scenes) {
    std::string found;
    for (const Json& seed : scene.at("seeds")) {
      const Json* const row = Find(seed.at("rows"), "fast");
      const Json* const objects = row == nullptr ? nullptr : Find(*row, "key_points.objects");
      if (objects == nullptr) continue;
      std::string names;
      for (const Json& object : *objects) {
        names += (names.empty() ? "" : ", ") + (object.is_string() ? object.get<std::string>() : "nothing that moves");
      }
      found += (found.empty() ? "" : "; ") + (names.empty() ? "none" : names);
    }
    if (found.empty()) continue;
    table.rows.push_back({scene.at("name"), found,
                          MeanAndRange(Collect(scene, "fast", "key_points.error_share", 100), 1),
                          MeanAndRange(Collect(scene, "fast", "key_points.error_share_95", 100), 1)});
  }
  return table;
}

BenchmarkTable Flow(const Json& scenes) {
  BenchmarkTable table{"optical flow between neighbouring training frames, end-point error in pixels",
                       {"scene", "flow", "where", "median", "90th percentile"},
                       {}};
  for (const Json& scene : scenes) {
    for (const Json& flow : scene.at("seeds").front().at("flow")) {
      for (const auto& part : flow.at("parts").items()) {
        table.rows.push_back({scene.at("name"), flow.at("name"), part.key(),
                              MeanAndRange({part.value().at("median")}, 2),
                              MeanAndRange({part.value().at("percentile90")}, 2)});
      }
    }
  }
  return table;
}

}  // namespace

std::string MeanAndRange(const std::vector<Json>& values, int digits) {
  std::vector<double> numbers;
  for (const Json& value : values) {
    if (value.is_number()) numbers.push_back(value.get<double>());
  }
  if (numbers.empty()) return "-";
  const double mean = std::accumulate(numbers.begin(), numbers.end(), 0.0) / static_cast<double>(numbers.size());
  std::string text = fmt::format("{:.{}f}", mean, digits);
  if (numbers.size() == 1) return text;
  const auto [least, most] = std::minmax_element(numbers.begin(), numbers.end());
  return fmt::format("{} ({:.{}f} to {:.{}f})", text, *least, digits, *most, digits);
}

std::vector<BenchmarkTable> LayOutTables(const Json& json) {
  const Json& scenes = json.at("scenes");
  std::vector<BenchmarkTable> tables;
  for (BenchmarkTable& table :
       std::vector<BenchmarkTable>{Fields(scenes, "reconstruction", "reconstruction: known states, new cameras"),
                                   Fields(scenes, "interpolation", "interpolation: states between training frames"),
                                   Fields(scenes, "editing", "editing: states that training never saw"), Ladder(scenes),
                                   Depth(scenes), KeyPoints(scenes), Flow(scenes)}) {
    if (!table.rows.empty()) tables.push_back(std::move(table));
  }
  return tables;
}

}  // namespace editnerf
