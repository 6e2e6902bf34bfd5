#include "libeditnerf/training/metrics_log.h"

#include <cmath>
#include <limits>

#include "libeditnerf/base/error.h"
#include "libeditnerf/base/file.h"
#include "tests/catch.h"
#include "tests/pickle_writer.h"

using namespace editnerf;
using editnerf::testing::Scratch;

namespace {

MetricsRow Row(int64_t step) {
  MetricsRow row;
  row.seconds_training = static_cast<double>(step) / 3;
  row.seconds_total = static_cast<double>(step) / 3 + 1.25;
  row.step = step;
  row.rays = step * 4096;
  row.samples = step * int64_t{5000000000};
  row.losses = {{"rec", 1.0 / static_cast<double>(step)}, {"geo", 1e-9}};
  return row;
}

}  // namespace

TEST_CASE("a metrics log is read back exactly") {
  const auto path = Scratch("metrics.csv", "left over from another run");
  auto second = Row(20);
  second.losses.erase("geo");
  second.losses["rec"] = std::numeric_limits<double>::quiet_NaN();
  second.held_out_psnr = 31.234567890123456;
  {
    MetricsLog log(path, {"rec", "geo"});
    log.Append(Row(10));
    log.Append(second);
  }
  CHECK(ReadFile(path).rfind("seconds_training,seconds_total,step,rays,samples,loss.rec,loss.geo,held_out_psnr\n", 0) ==
        0);
  const auto rows = ReadMetricsLog(path);
  REQUIRE(rows.size() == 2);
  CHECK(rows[0].seconds_training == 10.0 / 3);
  CHECK(rows[0].seconds_total == 10.0 / 3 + 1.25);
  CHECK(rows[0].samples == 50000000000);
  CHECK(rows[0].losses == Row(10).losses);
  CHECK_FALSE(rows[0].held_out_psnr.has_value());
  CHECK(rows[1].held_out_psnr == second.held_out_psnr);
  CHECK(rows[1].losses.count("geo") == 0);
  CHECK(std::isnan(rows[1].losses.at("rec")));
}

TEST_CASE("a resumed metrics log drops the rows past the checkpoint and takes new columns") {
  const auto path = Scratch("resumed.csv", "");
  {
    MetricsLog log(path, {"rec", "geo"});
    for (const int64_t step : {10, 20, 30}) log.Append(Row(step));
  }
  {
    MetricsLog log(path, {"rec", "motion"}, 20);
    CHECK(log.loss_terms() == std::vector<std::string>{"rec", "motion", "geo"});
    auto row = Row(25);
    row.losses = {{"motion", 3}};
    log.Append(row);
  }
  const auto rows = ReadMetricsLog(path);
  REQUIRE(rows.size() == 3);
  CHECK(rows[1].step == 20);
  CHECK(rows[1].losses == Row(20).losses);
  CHECK(rows[2].losses == std::map<std::string, double>{{"motion", 3}});
}

TEST_CASE("a metrics log whose last line was cut off is read up to there, and resumed") {
  const auto path = Scratch("cut.csv", "");
  {
    MetricsLog log(path, {"rec", "geo"});
    for (const int64_t step : {10, 20, 30}) log.Append(Row(step));
  }
  const std::string whole = ReadFile(path);
  for (const size_t cut : {1, 2, 9, 20}) {
    WriteFileAtomically(path, whole.substr(0, whole.size() - cut));
    CHECK(ReadMetricsLog(path).size() == 2);
  }
  MetricsLog(path, {"rec"}, 1000).Append([] {
    auto row = Row(40);
    row.losses.clear();
    return row;
  }());
  const auto rows = ReadMetricsLog(path);
  REQUIRE(rows.size() == 3);
  CHECK(rows[2].step == 40);
}

TEST_CASE("resuming without a metrics log starts one") {
  const auto path = Scratch("absent.csv", "");
  std::filesystem::remove(path);
  MetricsLog(path, {"rec"}, 500).Append({});
  CHECK(ReadMetricsLog(path).size() == 1);
}

TEST_CASE("a damaged metrics log is refused with file and line") {
  const std::string header = "seconds_training,seconds_total,step,rays,samples,held_out_psnr\n";
  const auto message = [&](const std::string& content) -> std::string {
    const auto path = Scratch("damaged.csv", content);
    try {
      ReadMetricsLog(path);
    } catch (const DataError& error) {
      return std::string(error.what()).substr(path.string().size());
    }
    return "no error";
  };
  CHECK(message("") == ": empty, expected a header");
  CHECK(message("step\n") == ":1: no column 'seconds_training'");
  CHECK(message(header + "1,2,3,4,5,\n1,2,3,4\n") == ":3: found 4 cells, expected 6");
  CHECK(message(header + "1,2,x,4,5,\n") == ":2: found 'x', expected a number");
  CHECK(message(header + "1,2,3.5,4,5,\n") == ":2: found '3.5', expected a number");
  CHECK(message(header + "1,,3,4,5,\n") == ":2: found '', expected a number");
  CHECK(message(header + "1,2,3,4,5,30.5\r\n") == "no error");
}

TEST_CASE("a metrics log names the mistakes of its caller") {
  const auto path = Scratch("caller.csv", "");
  CHECK_THROWS_WITH(MetricsLog(path, {"a,b"}), path.string() + ": a loss term called 'a,b' cannot head a column");
  MetricsLog log(path, {"rec"});
  CHECK_THROWS_WITH(log.Append(Row(1)), path.string() + ": no column for the loss term 'geo'");
  CHECK_THROWS_AS(MetricsLog("/nowhere/metrics.csv", {}), DataError);
}
