#include "support/run.h"

#include <torch/cuda.h>

#include <functional>
#include <iostream>
#include <sstream>
#include <vector>

#include "libeditnerf/base/error.h"
#include "libeditnerf/base/logging.h"
#include "libeditnerf/base/parallel.h"
#include "libeditnerf/config/reference.h"
#include "libeditnerf/config/yaml.h"
#include "support/config_files.h"
#include "tests/catch.h"

namespace editnerf {
namespace {

struct Outcome {
  int code = -1;
  std::string out, err;  // err: CLI11's messages and the log
  bool ran = false;
  CommonOptions common;
};

// Runs a program with one required argument, INPUT, in this process.
Outcome Run(std::vector<const char*> arguments, const std::function<void()>& body = {}) {
  arguments.insert(arguments.begin(), "enf-test");
  const auto argc = static_cast<int>(arguments.size());
  arguments.push_back(nullptr);
  std::ostringstream out, err;
  std::streambuf* const old_out = std::cout.rdbuf(out.rdbuf());
  std::streambuf* const old_err = std::cerr.rdbuf(err.rdbuf());
  SetLogSink([&](LogLevel, const std::string& message) { err << message << "\n"; });
  Outcome outcome;
  std::string input;
  outcome.code = RunProgram(
      "enf-test", "Tests.", argc, arguments.data(),
      [&](CLI::App& app) { app.add_option("INPUT", input, "what to read")->required(); },
      [&](const CommonOptions& common) {
        outcome.ran = true;
        outcome.common = common;
        if (body) body();
      });
  SetLogSink({});
  SetLogLevel(LogLevel::kError);
  SetNumThreads(2);
  std::cout.rdbuf(old_out);
  std::cerr.rdbuf(old_err);
  outcome.out = out.str();
  outcome.err = err.str();
  return outcome;
}

}  // namespace

TEST_CASE("a program runs with the default configuration and what --set changes") {
  const Outcome plain = Run({"x"});
  CHECK(plain.code == 0);
  CHECK(plain.ran);
  CHECK_FALSE(plain.common.config_given);
  CHECK(ToYaml(plain.common.config) == ToYaml(LoadNamedConfig("fast")));
  const Outcome set =
      Run({"--set", "train.steps=7", "x", "--set", "train.steps=9", "--config", "paper", "--seed", "5"});
  CHECK(set.code == 0);
  CHECK(set.common.config_given);
  CHECK(set.common.config.train.steps == 9);
  CHECK(set.common.config.field.kind == "paper");
  CHECK(set.common.seed == 5);
}

TEST_CASE("the short names are the files of configs/") {
  for (const std::string& name : ConfigNames()) {
    INFO(name);
    CHECK(ToYaml(LoadNamedConfig(name)) ==
          ToYaml(LoadConfig(std::string(EDITNERF_SOURCE_DIR "/configs/") + name + ".yaml", LoadShortName)));
  }
  CHECK(ConfigNames() == std::vector<std::string>{"fast", "fine", "paper", "tiny"});
}

TEST_CASE("fine is fast but for a few settings") {
  const Config fast = LoadNamedConfig("fast"), fine = LoadNamedConfig("fine");
  CHECK(fine.render.march_steps > fast.render.march_steps);
  CHECK(fine.render.occupancy_resolution > fast.render.occupancy_resolution);
  Config other = fine;
  other.render = fast.render;
  other.train.seconds = fast.train.seconds;
  other.field.fast.canonical_hash.log2_table_size = fast.field.fast.canonical_hash.log2_table_size;
  other.field.fast.local_hash.log2_table_size = fast.field.fast.local_hash.log2_table_size;
  CHECK(ToYaml(other) == ToYaml(fast));
}

TEST_CASE("mistakes on the command line end with code 2 and say what is wrong") {
  CHECK(Run({}).code == 2);
  CHECK(Run({}).err.find("INPUT is required") == 0);
  CHECK(Run({"x", "--bogus"}).code == 2);
  CHECK(Run({"x", "--threads", "-1"}).code == 2);
  CHECK(Run({"x", "--seed", "many"}).code == 2);
  CHECK(Run({"x", "--device", "gpu"}).code == 2);
  CHECK(Run({"x", "--verbose", "--quiet"}).code == 2);
  const Outcome unknown = Run({"x", "--set", "train.step=5"});
  CHECK(unknown.code == 2);
  CHECK(unknown.err == "--set train.step=5: unknown key 'train.step'; did you mean 'steps'?\n");
  CHECK_FALSE(unknown.ran);
  const Outcome missing = Run({"x", "--config", "nope"});
  CHECK(missing.code == 2);
  CHECK(missing.err == "nope: no such configuration; expected a YAML file or one of fast, fine, paper, tiny\n");
  CHECK(Run({"x", "--set", "field.warp.skip_layer=9"}).err ==
        "--set: field.warp.skip_layer is 9, expected less than field.warp.depth (2), or 0\n");
}

TEST_CASE("an absent CUDA device is a configuration error") {
  if (torch::cuda::is_available()) {
    WARN("skipped: a CUDA device is present");
    return;
  }
  const Outcome outcome = Run({"x", "--device", "cuda"});
  CHECK(outcome.code == 2);
  CHECK(outcome.err == "--device cuda: no CUDA device is available; use --device cpu or auto\n");
}

TEST_CASE("information needs no input") {
  const Outcome version = Run({"--version"});
  CHECK(version.code == 0);
  CHECK(version.out.find("enf-test ") == 0);
  CHECK(Run({"--help"}).code == 0);
  CHECK(Run({"--print-config-reference"}).out == ConfigReference());
  const Outcome config = Run({"--config", "tiny", "--set", "train.steps=77", "--print-config"});
  CHECK(config.code == 0);
  Config expected = LoadNamedConfig("tiny");
  expected.train.steps = 77;
  CHECK(config.out == ToYaml(expected));
  CHECK_FALSE(config.ran);
}

TEST_CASE("the kinds of errors have their exit codes") {
  CHECK(Run({"x"}, [] { throw ConfigError("c"); }).code == 2);
  CHECK(Run({"x"}, [] { throw DataError("d"); }).code == 1);
  CHECK(Run({"x"}, [] { throw DataError("d"); }).err == "d\n");
  CHECK(Run({"x"}, [] { throw Interrupted("i"); }).code == 130);
  CHECK(Run({"x"}, [] { throw std::bad_alloc(); }).code == 1);
  const auto torch_error = [] { torch::zeros({2}) + torch::zeros({3}); };
  const Outcome brief = Run({"x"}, torch_error), verbose = Run({"x", "--verbose"}, torch_error);
  CHECK(brief.code == 1);
  CHECK(brief.err.size() < verbose.err.size());
}

TEST_CASE("a run's own configuration stands unless --config is given") {
  Config run_config;
  run_config.train.steps = 1234;
  run_config.field.warp.depth = 5;
  const Config kept = Run({"x", "--set", "render.early_stop=0.25"}).common.Over(run_config);
  CHECK(kept.train.steps == 1234);
  CHECK(kept.render.early_stop == 0.25);
  const Config replaced = Run({"x", "--config", "tiny", "--set", "render.early_stop=0.25"}).common.Over(run_config);
  CHECK(replaced.train.steps == 300);
  CHECK(replaced.render.early_stop == 0.25);
}

}  // namespace editnerf
