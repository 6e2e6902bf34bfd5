#include "libeditnerf/benchmarks/tables_layout.h"

#include <algorithm>

#include "tests/catch.h"

using namespace editnerf;

namespace {

Json Seed(double edits, double depth) {
  Json seed = Json::parse(R"({
    "rows": {
      "hypernerf": {"reconstruction.psnr": 30.0, "seconds.pretrain_only": 60.2,
                    "depth": {"static": {"median": 0.003, "percentile90": 0.01},
                              "lid": {"median": 0.05, "percentile90": 0.2}}},
      "base": {"editing.psnr": 20.0},
      "fast": {"reconstruction.psnr": 33.5, "reconstruction_nearest.psnr": 18.25, "editing.lpips": null,
               "key_points.objects": ["lid", null], "key_points.error_share": 0.012, "key_points.error_share_95": 0.03}
    },
    "ladder": [{"name": "base", "description": "nothing"}, {"name": "fast", "description": "everything"}],
    "known_depth": {"lid": {"median": 0.01, "percentile90": 0.02}},
    "flow": [{"name": "DIS", "parts": {"moving": {"median": 0.25, "percentile90": 1.5, "pixels": 9}}}]
  })");
  seed["rows"]["fast"]["editing.psnr"] = edits;
  seed["rows"]["fast"]["depth"] = {{"lid", {{"median", depth}, {"percentile90", 2 * depth}}}};
  return seed;
}

const BenchmarkTable* Find(const std::vector<BenchmarkTable>& tables, const std::string& beginning) {
  const auto found = std::find_if(tables.begin(), tables.end(),
                                  [&](const BenchmarkTable& table) { return table.title.rfind(beginning, 0) == 0; });
  return found == tables.end() ? nullptr : &*found;
}

using Rows = std::vector<std::vector<std::string>>;

}  // namespace

TEST_CASE("a value of a table is the mean over seeds, with the range of several") {
  CHECK(MeanAndRange({}, 2) == "-");
  CHECK(MeanAndRange({Json()}, 2) == "-");
  CHECK(MeanAndRange({24.966}, 2) == "24.97");
  CHECK(MeanAndRange({24.5, Json(), 25.5}, 1) == "25.0 (24.5 to 25.5)");
}

TEST_CASE("the tables of two seeds") {
  Json json;
  json["scenes"] = Json::array({{{"name", "chest"}, {"seeds", {Seed(30, 0.02), Seed(31, 0.04)}}}});
  const std::vector<BenchmarkTable> tables = LayOutTables(json);
  CHECK(Find(tables, "interpolation") == nullptr);  // nobody measured it
  for (const BenchmarkTable& table : tables) {
    INFO(table.title);
    for (const auto& row : table.rows) CHECK(row.size() == table.headers.size());
  }

  const BenchmarkTable* const reconstruction = Find(tables, "reconstruction");
  REQUIRE(reconstruction != nullptr);
  REQUIRE(reconstruction->rows.size() == 3);
  CHECK(reconstruction->rows[0][1] == "HyperNeRF stage, fast field");
  CHECK(reconstruction->rows[1][2] == "33.50 (33.50 to 33.50)");
  CHECK(reconstruction->rows[2] == std::vector<std::string>{"chest", "nearest training image", "18.25 (18.25 to 18.25)",
                                                            "-", "-", "-", "-", "-", "-"});

  const BenchmarkTable* const ladder = Find(tables, "ablation");
  REQUIRE(ladder != nullptr);
  REQUIRE(ladder->rows.size() == 2);
  CHECK(ladder->rows[0][1] == "nothing");
  CHECK(ladder->rows[1][1] == "everything");
  CHECK(ladder->rows[1][2] == "30.50 (30.00 to 31.00)");
  CHECK(ladder->rows[1][5] == "-");  // a null is no number
  CHECK(ladder->rows[1][7] == "1.2 (1.2 to 1.2)");

  const BenchmarkTable* const depth = Find(tables, "depth");
  REQUIRE(depth != nullptr);
  CHECK(depth->rows == Rows{{"chest", "lid", "5.00 (5.00 to 5.00) / 20.00 (20.00 to 20.00)",
                             "1.00 (1.00 to 1.00) / 2.00 (2.00 to 2.00)", "3.00 (2.00 to 4.00) / 6.00 (4.00 to 8.00)"},
                            {"chest", "static", "0.30 (0.30 to 0.30) / 1.00 (1.00 to 1.00)", "-", "-"}});

  const BenchmarkTable* const key_points = Find(tables, "key points");
  REQUIRE(key_points != nullptr);
  CHECK(key_points->rows[0][1] == "lid, nothing that moves; lid, nothing that moves");

  const BenchmarkTable* const flow = Find(tables, "optical flow");
  REQUIRE(flow != nullptr);
  CHECK(flow->rows == Rows{{"chest", "DIS", "moving", "0.25", "1.50"}});
}
