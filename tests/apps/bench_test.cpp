// enf-bench in processes of its own, as small as it goes: what it writes, not how fast anything was.
#include <set>
#include <string>
#include <vector>

#include "libeditnerf/imaging/json_file.h"
#include "libeditnerf/kernels/bf16_unit.h"
#include "libeditnerf/poses/child_process.h"
#include "tests/catch.h"
#include "tests/imaging/scratch_folder.h"

using namespace editnerf;

namespace {

namespace fs = std::filesystem;

// The JSON of enf-bench with these arguments, which must succeed.
Json Bench(const ScratchFolder& folder, std::vector<std::string> arguments) {
  ChildProcess child;
  child.arguments = {EDITNERF_BINARY_DIR "/apps/enf-bench"};
  child.arguments.insert(child.arguments.end(), arguments.begin(), arguments.end());
  child.arguments.insert(child.arguments.end(), {"--json", (folder / "bench.json").string(), "--threads", "2"});
  child.log = folder / "log.txt";
  const int code = RunChild(child);
  INFO(ReadText(child.log));
  REQUIRE(code == 0);
  const Json json = ReadJson(folder / "bench.json");
  CHECK(json.at("benchmark") == arguments.front());
  CHECK(json.at("machine").at("threads") == 2);
  CHECK_FALSE(json.at("machine").at("instruction_set").get<std::string>().empty());
  CHECK(json.at("machine").at("version") == "0.1.0");
  CHECK(json.at("peak_resident_bytes") > 0);
  return json;
}

// A field and a scene of the size that tests take.
std::vector<std::string> Small(std::vector<std::string> arguments) {
  for (const char* setting :
       {"field.fast.canonical_hash.log2_table_size=10", "field.fast.local_hash.log2_table_size=10",
        "render.occupancy_resolution=16", "train.samples_per_step=2048", "pretrain.samples_per_step=2048"}) {
    arguments.insert(arguments.end(), {"--set", setting});
  }
  return arguments;
}

const std::vector<std::string> kSmallScene = {"--frames", "4", "--width", "32", "--height", "18"};

std::vector<std::string> WithScene(std::vector<std::string> arguments) {
  arguments.insert(arguments.end(), kSmallScene.begin(), kSmallScene.end());
  return Small(arguments);
}

}  // namespace

TEST_CASE("enf-bench kernels compares every kernel with its reference, for one thread and for all") {
  const ScratchFolder folder;
  const Json json =
      Bench(folder, Small({"kernels", "--samples", "1024", "--repeats", "1", "--least-seconds", "0.0001"}));
  REQUIRE(json.at("runs").size() == 2);
  for (const Json& run : json.at("runs")) {
    CHECK(run.at("peak_gflops") > 0);
    const size_t fused_kernels = Bf16UnitsHere().empty() ? 1 : 2;
    CHECK(run.at("kernels").size() == 10 + 3 * fused_kernels + 2 * Bf16UnitsHere().size());
    for (const Json& kernel : run.at("kernels")) {
      INFO(kernel.dump());
      CHECK(kernel.at("nanoseconds") > 0);
      CHECK(kernel.at("reference_processor_nanoseconds") > 0);
      CHECK(kernel.at("ratio") > 0);
      if (kernel.contains("gflops")) CHECK(kernel.at("share_of_peak") > 0);
    }
    CHECK(run.at("field_parts").size() == 7 * fused_kernels);
    for (const Json& parts : run.at("field_parts")) {
      INFO(parts.dump());
      CHECK(parts.at("operations") > 0);
      CHECK(parts.at("of_one_key_point") > 0);
      double sum = 0;
      for (const Json& nanoseconds : parts.at("phases")) sum += nanoseconds.get<double>();
      CHECK(sum == Approx(parts.at("processor_nanoseconds").get<double>()));
    }
  }
  CHECK(json.at("runs")[0].at("threads") == 1);
  CHECK(json.at("runs")[1].at("threads") == 2);
}

TEST_CASE("enf-bench train splits the time of a step into shares that sum to one") {
  const ScratchFolder folder;
  for (const char* stage : {"train", "pretrain"}) {
    INFO(stage);
    const Json json = Bench(
        folder, WithScene({"train", "cups", "--stage", stage, "--warm-up", "2", "--steps", "2", "--repeats", "1"}));
    CHECK(json.at("stage") == stage);
    CHECK(json.at("key_points") == (std::string(stage) == "train" ? 2 : 0));
    for (const char* way : {"fused", "modules"}) CHECK(json.at(way).at("samples_per_second") > 0);
    CHECK(json.at("ratio") > 0);
    CHECK(json.at("memory_plan").at("total") > 0);
    double sum = 0;
    for (const auto& phase : json.at("phases").items()) {
      INFO(phase.key());
      CHECK(phase.value() >= (phase.key() == "rest" ? -0.01 : 0.0));
      sum += phase.value().get<double>();
    }
    CHECK(sum == Approx(1));
    for (const char* phase : {"encoding", "products", "table_gradients", "compositing", "marching", "adam"}) {
      INFO(phase);
      CHECK(json.at("phases").at(phase) > 0);
    }
  }
}

TEST_CASE("enf-bench growth measures steps of several sizes and scenes of several lengths") {
  const ScratchFolder folder;
  const Json json = Bench(folder, Small({"growth", "--scene", "hinge", "--samples", "1024", "--samples", "2048",
                                         "--frames", "3", "--frames", "5", "--warm-up", "1", "--steps", "1"}));
  REQUIRE(json.at("samples").size() == 2);
  CHECK(json.at("samples")[1].at("samples_per_step") == 2048);
  REQUIRE(json.at("frames").size() == 2);
  CHECK(json.at("frames")[1].at("frames") == 5);
  for (const Json& point : json.at("frames")) CHECK(point.at("step_seconds") > 0);
}

TEST_CASE("enf-bench render trains a scene and shows it at every size") {
  const ScratchFolder folder;
  const Json json = Bench(folder, WithScene({"render", "static", "--seconds", "0.1", "--pictures", "1"}));
  std::vector<std::string> names;
  for (const Json& picture : json.at("pictures")) {
    names.push_back(picture.at("name"));
    CHECK(picture.at("frames_per_second") > 0);
  }
  CHECK(names == std::vector<std::string>{"picture", "picture", "picture", "preview", "float32", "modules"});
  CHECK(json.at("pictures")[3].at("width") == 16);
}

TEST_CASE("enf-bench diagram draws error against run time and says what reached which error when") {
  const ScratchFolder folder;
  const fs::path out = folder / "diagram";
  const Json json =
      Bench(folder, WithScene({"diagram", "hinge", "--out", out.string(), "--seconds", "0.2", "--measurements", "2",
                               "--variants", "fast,no-local", "--set", "train.rays_per_step=64"}));
  REQUIRE(json.at("variants").size() == 2);
  for (const Json& variant : json.at("variants")) {
    CHECK(variant.at("points").size() >= 1);
    CHECK(variant.at("psnr") > 0);
    CHECK(variant.at("editing_psnr") > 0);
    CHECK(variant.at("seconds_to").contains("25"));
    CHECK(variant.at("seconds_to").at("40").is_null());
  }
  CHECK(ReadText(out / "diagram.svg").find("<svg") == 0);
}

TEST_CASE("enf-bench stability finds every operator within its bounds, and transmittance convergent") {
  const ScratchFolder folder;
  const Json json = Bench(folder, {"stability", "--repeats", "1", "--least-seconds", "0.0001"});
  CHECK(json.at("failed") == 0);
  std::set<std::string> operations;
  for (const Json& row : json.at("rows")) {
    INFO(row.dump());
    operations.insert(row.at("operation").get<std::string>());
    CHECK(row.at("passes") == true);
    CHECK(row.at("finite") == true);
    CHECK(row.at("error") <= row.at("bound"));
    if (!row.at("gradient_bound").is_null()) CHECK(row.at("gradient_error") <= row.at("gradient_bound"));
  }
  CHECK(operations == std::set<std::string>{"SE(3) exponential",
                                            "clamped exp",
                                            "compositing",
                                            "distortion",
                                            "early stop",
                                            "fused pass",
                                            "fused pass, all objectives",
                                            "fused pass, background",
                                            "fused pass, depth",
                                            "fused pass, distortion",
                                            "hash encoding",
                                            "key point weights",
                                            "local frames",
                                            "look-up",
                                            "marching",
                                            "positional encoding",
                                            "projection",
                                            "small network",
                                            "softmax",
                                            "softplus"});
  for (const Json& point : json.at("integration")) {
    INFO(point.dump());
    const auto way = point.at("way").get<std::string>();
    const auto thickness = point.at("thickness").get<double>(), steps = point.at("steps").get<double>();
    CHECK(point.at("nanoseconds") > 0);
    if (way == "explicit Euler, float32") {
      if (thickness == 1e6) CHECK(point.at("error").is_null());  // unstable
    } else if (way == "cumprod(1 - alpha), float32") {
      if (thickness == 1e-6 && steps >= 256) CHECK(point.at("error") > 0.5);  // every alpha rounds to 0
    } else {
      CHECK(point.at("error") < 12 / (steps * steps) + 1e-6);  // of second order, down to rounding
    }
  }
}

TEST_CASE("enf-bench names a scene that is not there and a variant that it does not know") {
  const ScratchFolder folder;
  const auto fails = [&](std::vector<std::string> arguments, int code, const std::string& text) {
    ChildProcess child;
    child.arguments = {EDITNERF_BINARY_DIR "/apps/enf-bench"};
    child.arguments.insert(child.arguments.end(), arguments.begin(), arguments.end());
    child.log = folder / "log.txt";
    CHECK(RunChild(child) == code);
    CHECK_THAT(ReadText(child.log), HasText(text));
  };
  fails({"train", "nowhere"}, 1, "nowhere: no such scene; expected a scene folder, a packed scene, or one of");
  fails({"diagram", "hinge", "--frames", "4", "--width", "32", "--height", "18", "--out", (folder / "out").string(),
         "--variants", "fest"},
        2, "--variants: unknown configuration 'fest'");
  fails({}, 2, "subcommand");
}

TEST_CASE("enf-bench tables goes the whole way on a scene, and does not run again what is finished") {
  const ScratchFolder folder;
  std::vector<std::string> arguments =
      WithScene({"tables", "hinge", "--out", (folder / "runs").string(), "--max-frames", "1", "--set",
                 "pretrain.steps=150", "--set", "train.steps=20"});
  const Json json = Bench(folder, arguments);
  const Json& seed = json.at("scenes").at(0).at("seeds").at(0);
  for (const char* row : {"hypernerf", "fast"}) {
    INFO(row);
    CHECK(seed.at("rows").at(row).at("reconstruction.psnr").is_number());
    CHECK(seed.at("rows").at(row).at("depth").at("lid").at("pixels") > 0);
  }
  CHECK(seed.at("flow").at(0).at("name") == "DIS");
  const Json scores = ReadJson(folder / "runs/hinge/seed_1/fast/scores.json");
  CHECK(scores == seed.at("rows").at("fast"));
  const auto written = fs::last_write_time(folder / "runs/hinge/seed_1/fast/checkpoint.safetensors");
  CHECK(Bench(folder, arguments).at("scenes") == json.at("scenes"));
  CHECK(fs::last_write_time(folder / "runs/hinge/seed_1/fast/checkpoint.safetensors") == written);
}
