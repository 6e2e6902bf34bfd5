#include "libeditnerf/config/yaml.h"

#include <fmt/format.h>

#include <filesystem>
#include <limits>
#include <string>

#include "libeditnerf/base/error.h"
#include "libeditnerf/base/file.h"
#include "libeditnerf/config/schema.h"
#include "libeditnerf/config/validate.h"
#include "tests/catch.h"

namespace editnerf {
namespace {

const std::filesystem::path kConfigs = std::filesystem::path(EDITNERF_SOURCE_DIR) / "configs";

// The message of the ConfigError that `body` throws.
template <class Body>
std::string ErrorOf(const Body& body) {
  try {
    body();
  } catch (const ConfigError& error) {
    return error.what();
  }
  return "no error";
}

std::string LoadError(const std::string& text) {
  return ErrorOf([&] { LoadConfigText(text, "configs/dice.yaml"); });
}

std::string OverrideError(const std::string& assignment) {
  return ErrorOf([&] {
    Config config;
    ApplyOverride(config, assignment);
  });
}

// The one configuration that a file may be based on here: the defaults, but for the steps of training.
Config Twice(const std::string& name) {
  if (name != "twice" && name != "fast") Throw<ConfigError>("expected 'twice', found '{}'", name);
  Config config;
  config.train.steps *= 2;
  return config;
}

struct Named {
  std::string text;
  template <class Visitor>
  void Visit(Visitor& v) {
    v("text", text, "any text");
  }
};

}  // namespace

TEST_CASE("every configuration file of the project loads and survives a round trip") {
  int64_t count = 0;
  for (const auto& entry : std::filesystem::directory_iterator(kConfigs)) {
    if (entry.path().extension() != ".yaml") continue;
    INFO(entry.path());
    const Config config = LoadConfig(entry.path(), Twice);
    CHECK_NOTHROW(ValidateConfig(config, "again"));
    const std::string text = ToYaml(config);
    CHECK(ToYaml(LoadConfigText(text, "round trip")) == text);
    ++count;
  }
  CHECK(count >= 3);
}

TEST_CASE("paper.yaml holds the defaults, but for the frames held out and the losses that pretraining lacks") {
  Config expected;
  expected.pretrain.lambda_motion = 0;
  expected.pretrain.lambda_geometry = 0;
  expected.data.hold_out = "odd";
  CHECK(ToYaml(LoadConfig(kConfigs / "paper.yaml")) == ToYaml(expected));
  CHECK(expected.train.steps == 250000);
  CHECK(expected.field.nerf.width == 256);
  CHECK(expected.field.weights.depth == 4);
}

TEST_CASE("an empty file, a comment and empty groups are the defaults") {
  const std::string defaults = ToYaml(Config());
  for (const char* text : {"", "# nothing\n", "---\n", "train:\n  # steps: 5\nfield:\n  warp:\n"}) {
    INFO(text);
    CHECK(ToYaml(LoadConfigText(text, "empty.yaml")) == defaults);
  }
}

TEST_CASE("a file changes what it names and nothing else") {
  const Config config = LoadConfigText(
      "field:\n  warp: {enabled: false, depth: 5}\n  kind: \"fast\"\ntrain: &stage\n  steps: +12\n  learning_rate: "
      "2e-3\n"
      "pretrain: *stage\n",
      "some.yaml");
  Config expected;
  expected.field.warp.enabled = Choice::kOff;
  expected.field.warp.depth = 5;
  expected.field.kind = "fast";
  expected.train.steps = expected.pretrain.steps = 12;
  expected.train.learning_rate = expected.pretrain.learning_rate = 2e-3;
  CHECK(ToYaml(config) == ToYaml(expected));
}

TEST_CASE("a file with a base changes what it names there") {
  Config expected = Twice("twice");
  expected.render.march_steps = 99;
  const std::string text = "render:\n  march_steps: 99\nbase: twice\n";
  CHECK(ToYaml(LoadConfigText(text, "dice.yaml", Twice)) == ToYaml(expected));
  CHECK(ToYaml(LoadConfigText("base: twice", "dice.yaml", Twice)) == ToYaml(Twice("twice")));
  const auto error = [](const std::string& wrong) {
    return ErrorOf([&] { LoadConfigText(wrong, "dice.yaml", Twice); });
  };
  CHECK(error("\nbase: thrice\n") == "dice.yaml:2: 'base': expected 'twice', found 'thrice'");
  CHECK(error("base: [twice]") == "dice.yaml:1: 'base': expected the name of a configuration, found a list");
  CHECK(error("base: twice\nbase: twice\n").find("dice.yaml:2: unknown key 'base'") == 0);
  CHECK(error("base: twice\nrender:\n  march_step: 9\n").find("dice.yaml:3: unknown key 'render.march_step'") == 0);
  CHECK(LoadError("base: twice\n").find("configs/dice.yaml:1: unknown key 'base'") == 0);
}

TEST_CASE("a component is there, is not, or is left open") {
  for (const auto& [text, choice] :
       {std::pair{"true", Choice::kOn}, {"false", Choice::kOff}, {"auto", Choice::kAuto}}) {
    const Config config = LoadConfigText(std::string("field: {use_appearance: ") + text + "}", "some.yaml");
    CHECK(config.field.use_appearance == choice);
    CHECK(LoadConfigText(ToYaml(config), "again.yaml").field.use_appearance == choice);
  }
}

TEST_CASE("numbers survive the round trip exactly") {
  Config config;
  config.train.learning_rate = 0.1 + 0.2;
  config.train.final_learning_rate = std::numeric_limits<double>::denorm_min();
  config.train.steps = std::numeric_limits<int64_t>::max();
  const Config read = LoadConfigText(ToYaml(config), "exact.yaml");
  CHECK(read.train.learning_rate == config.train.learning_rate);
  CHECK(read.train.final_learning_rate == config.train.final_learning_rate);
  CHECK(read.train.steps == config.train.steps);
}

TEST_CASE("unknown keys name the line and the nearest valid key") {
  CHECK(LoadError("field:\n  weights: {num_octave: 3}\n") ==
        "configs/dice.yaml:2: unknown key 'field.weights.num_octave'; did you mean 'num_octaves'?");
  CHECK(LoadError("trian:\n  steps: 3\n") == "configs/dice.yaml:1: unknown key 'trian'; did you mean 'train'?");
  CHECK(LoadError("\nsteps: 3\n") ==
        "configs/dice.yaml:2: unknown key 'steps'; did you mean 'pretrain.steps' or 'train.steps'?");
  CHECK(LoadError("data:\n  colour: 3\n") ==
        "configs/dice.yaml:2: unknown key 'data.colour'; known here: image_factor, max_side, hold_out");
  CHECK(LoadError("train:\n  <<: 3\n").find("configs/dice.yaml:2: unknown key 'train.<<'; known here: steps") == 0);
}

TEST_CASE("wrong types say what was expected and found") {
  CHECK(LoadError("train:\n  steps: 1.5\n") ==
        "configs/dice.yaml:2: 'train.steps': expected an integer of at least 1, found '1.5'");
  CHECK(LoadError("train:\n  steps: \"5\"\n") ==
        "configs/dice.yaml:2: 'train.steps': expected an integer of at least 1, found '\"5\"'");
  CHECK(LoadError("train:\n  steps: 99999999999999999999\n") ==
        "configs/dice.yaml:2: 'train.steps': expected an integer of at least 1, found '99999999999999999999'");
  CHECK(LoadError("train:\n  steps: [1]\n") ==
        "configs/dice.yaml:2: 'train.steps': expected an integer of at least 1, found a list");
  CHECK(LoadError("train:\n  steps:\n").find("expected an integer of at least 1, found nothing") != std::string::npos);
  CHECK(LoadError("train:\n  skip_interval: 1\n").find("did you mean 'detect.skip_interval'?") != std::string::npos);
  CHECK(LoadError("detect:\n  refine: yes\n") ==
        "configs/dice.yaml:2: 'detect.refine': expected true or false, found 'yes'");
  CHECK(LoadError("field:\n  use_appearance: maybe\n") ==
        "configs/dice.yaml:2: 'field.use_appearance': expected true, false or auto, found 'maybe'");
  CHECK(LoadError("train: 5\n") == "configs/dice.yaml:1: 'train': expected a group of settings, found '5'");
  CHECK(LoadError("- 5\n") == "configs/dice.yaml:1: expected a group of settings, found a list");
  CHECK(LoadError("? [1]\n: 2\n") == "configs/dice.yaml:1: expected a name, found a list");
  CHECK(LoadError("train:\n  steps: " + std::string(200, 'x')).size() < 160);
}

TEST_CASE("values out of range say the range") {
  CHECK(LoadError("field:\n  warp:\n    depth: 33\n") ==
        "configs/dice.yaml:3: 'field.warp.depth': expected an integer between 1 and 32, found '33'");
  CHECK(LoadError("train:\n  learning_rate: 0\n") ==
        "configs/dice.yaml:2: 'train.learning_rate': expected a number greater than 0, found '0'");
  CHECK(LoadError("field:\n  kind: papr\n") ==
        "configs/dice.yaml:2: 'field.kind': expected one of 'paper', 'fast', found 'papr'; did you mean 'paper'?");
  for (const char* number : {".nan", ".inf", "-.inf", "nan", "inf", "1e999", "0x10", "1_0", "--1", "+-1", "1 2"}) {
    INFO(number);
    CHECK(LoadError(fmt::format("train:\n  learning_rate: {}\n", number)) ==
          fmt::format("configs/dice.yaml:2: 'train.learning_rate': expected a number greater than 0, found '{}'",
                      number));
  }
}

TEST_CASE("duplicate keys are errors that name both lines") {
  CHECK(LoadError("train:\n  steps: 3\n  seconds: 1\n  steps: 3\n") ==
        "configs/dice.yaml:4: duplicate key 'train.steps', first given in line 2");
  CHECK(LoadError("train: {steps: 3}\ndata: {}\ntrain: {}\n") ==
        "configs/dice.yaml:3: duplicate key 'train', first given in line 1");
}

TEST_CASE("settings that do not fit each other name the one to change and its line") {
  CHECK(LoadError("field:\n  nerf:\n    depth: 8\n    skip_layer: 8\n") ==
        "configs/dice.yaml:4: field.nerf.skip_layer is 8, expected less than field.nerf.depth (8), or 0");
  CHECK(LoadError("field:\n  warp:\n    depth: 3\n") ==
        "configs/dice.yaml: field.warp.skip_layer is 4, expected less than field.warp.depth (3), or 0");
  CHECK(LoadError("field:\n  fast:\n    local_hash: {finest_resolution: 8}\n") ==
        "configs/dice.yaml:3: field.fast.local_hash.finest_resolution is 8, expected at least "
        "field.fast.local_hash.base_resolution (16)");
  CHECK(LoadError("pretrain:\n  final_learning_rate: 0.1\n") ==
        "configs/dice.yaml:2: pretrain.final_learning_rate is 0.1, expected at most pretrain.learning_rate (0.001)");
}

TEST_CASE("a configuration made in code is validated like a file") {
  Config config;
  config.train.rays_per_step = 0;
  CHECK(ErrorOf([&] { ValidateConfig(config, "here"); }) ==
        "here: 'train.rays_per_step': expected an integer between 1 and 1048576, found '0'");
  config = Config();
  config.train.learning_rate = std::numeric_limits<double>::quiet_NaN();
  CHECK(ErrorOf([&] { ValidateConfig(config, "here"); }) ==
        "here: 'train.learning_rate': expected a number greater than 0, found 'nan'");
}

TEST_CASE("broken YAML names the line") {
  CHECK(LoadError("train:\n  steps: [1\n").find("configs/dice.yaml:3: not valid YAML: ") == 0);
  CHECK(LoadError("train:\n  steps: *unknown\n").find("configs/dice.yaml:2: not valid YAML: ") == 0);
  CHECK(LoadError("a: b: c\n").find("configs/dice.yaml:1: not valid YAML: ") == 0);
  CHECK(LoadError("train: {}\n---\ntrain: {}\n") == "configs/dice.yaml: expected one YAML document, found several");
}

TEST_CASE("hostile YAML is refused quickly") {
  CHECK(LoadError("train: &a\n  steps: *a\n").find("found a mapping") != std::string::npos);
  CHECK(LoadError("data: &a\n  data: *a\n").find("configs/dice.yaml:2: unknown key 'data.data'") == 0);
  CHECK(LoadError(std::string(100000, '[')) == "configs/dice.yaml:1: nested deeper than 32 levels");
  std::string bomb = "a0: &a0 [x, x]\n";
  for (int i = 1; i < 60; ++i) bomb += fmt::format("a{0}: &a{0} [*a{1}, *a{1}]\n", i, i - 1);
  CHECK(LoadError(bomb).find("configs/dice.yaml:1: unknown key 'a0'") == 0);
  std::string many = "train: [";
  for (int i = 0; i < 20000; ++i) many += "1,";
  CHECK(LoadError(many + "]") == "configs/dice.yaml:1: more than 10000 values");
  CHECK(LoadError(std::string(2 << 20, '#')) == "configs/dice.yaml: 2097152 bytes, expected at most 1048576");
}

TEST_CASE("a missing configuration file is a configuration error") {
  CHECK(ErrorOf([] { LoadConfig("/nonexistent/x.yaml"); }) == "/nonexistent/x.yaml: no such file");
}

TEST_CASE("an override sets one setting, or a group of them") {
  Config config;
  ApplyOverride(config, "train.steps=100");
  ApplyOverride(config, "field.kind=fast");
  ApplyOverride(config, "pretrain={steps: 7, seconds: 2.5}");
  CHECK(config.train.steps == 100);
  CHECK(config.field.kind == "fast");
  CHECK(config.pretrain.steps == 7);
  CHECK(config.pretrain.seconds == 2.5);
}

TEST_CASE("a bad override is quoted, and changes nothing") {
  CHECK(OverrideError("train.steps=0") ==
        "--set train.steps=0: 'train.steps': expected an integer of at least 1, found '0'");
  CHECK(OverrideError("train.step=5") == "--set train.step=5: unknown key 'train.step'; did you mean 'steps'?");
  CHECK(OverrideError("train.steps.x=5") ==
        "--set train.steps.x=5: unknown key 'train.steps.x'; 'train.steps' is an integer of at least 1");
  CHECK(OverrideError("train=5") == "--set train=5: 'train': expected a group of settings, found '5'");
  CHECK(OverrideError("train.steps") == "--set train.steps: expected KEY=VALUE, for example train.steps=100");
  CHECK(OverrideError("=5").find("expected KEY=VALUE") != std::string::npos);
  CHECK(OverrideError("train.=5").find("--set train.=5: unknown key 'train.'; known here: ") == 0);
  CHECK(OverrideError("train.steps=").find("expected an integer of at least 1, found nothing") != std::string::npos);
  CHECK(OverrideError("train.steps=[").find("--set train.steps=[: not valid YAML: ") == 0);
  Config config;
  CHECK_THROWS_AS(ApplyOverride(config, "pretrain={steps: 7, seconds: -1}"), ConfigError);
  CHECK(ToYaml(config) == ToYaml(Config()));
}

TEST_CASE("texts are quoted where YAML would read something else") {
  Named named;
  const Setting root = Describe(named);
  const auto written = [&](const std::string& text) {
    named.text = text;
    return ValueText(root.children[0]);
  };
  CHECK(written("plain/path-1.yaml") == "plain/path-1.yaml");
  CHECK(written("true") == "\"true\"");
  CHECK(written("1") == "\"1\"");
  CHECK(written("") == "\"\"");
  CHECK(written("a: \"b\"\n") == "\"a: \\\"b\\\"\\x0a\"");
}

}  // namespace editnerf
