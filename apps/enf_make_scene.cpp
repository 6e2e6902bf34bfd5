// enf-make-scene: writes a synthetic scene with exact ground truth as a scene folder.
#include <fmt/ranges.h>

#include <CLI/CLI.hpp>
#include <cstdio>
#include <filesystem>
#include <string>

#include "libeditnerf/base/error.h"
#include "libeditnerf/base/logging.h"
#include "libeditnerf/base/parallel.h"
#include "libeditnerf/imaging/scene_folder.h"
#include "libeditnerf/scene/synthetic/synthetic_scene.h"
#include "support/run.h"

namespace {

// "320x180".
void ParseSize(const std::string& text, editnerf::SyntheticOptions* options) {
  long long width = 0, height = 0;
  int used = 0;
  if (std::sscanf(text.c_str(), "%lldx%lld%n", &width, &height, &used) != 2 ||
      text.size() != static_cast<size_t>(used)) {
    editnerf::Throw<editnerf::ConfigError>("--size: expected WIDTHxHEIGHT such as 320x180, found '{}'", text);
  }
  options->width = width;
  options->height = height;
}

}  // namespace

int main(int argc, char** argv) {
  editnerf::SyntheticOptions options;
  std::string name, size = "320x180";
  std::filesystem::path out;
  int64_t threads = 0;
  CLI::App app("Writes a synthetic scene with exact ground truth: " +
               fmt::format("{}", fmt::join(editnerf::SyntheticSceneNames(), ", ")) + ".");
  app.add_option("name", name, "which scene")->required();
  app.add_option("--out", out, "scene folder to write")->required();
  app.add_option("--frames", options.frames, "training frames")->capture_default_str();
  app.add_option("--val-frames", options.val_frames, "known states from new cameras")->capture_default_str();
  app.add_option("--edit-frames", options.edit_frames, "states that training never shows")->capture_default_str();
  app.add_option("--size", size, "WIDTHxHEIGHT in pixels")->capture_default_str();
  app.add_option("--samples", options.samples_per_side, "antialiasing samples per pixel side")->capture_default_str();
  app.add_option("--seed", options.seed, "of the camera's wandering and the edits")->capture_default_str();
  app.add_option("--threads", threads, "0 takes every core")->capture_default_str();
  try {
    app.parse(argc, argv);
  } catch (const CLI::ParseError& error) {
    return app.exit(error) == 0 ? 0 : 2;
  }
  return editnerf::RunProgram([&] {
    ParseSize(size, &options);
    editnerf::SetNumThreads(threads);
    editnerf::WriteSceneFolder(editnerf::MakeSyntheticScene(name, options), out);
    editnerf::LogInfo("wrote {}", out.string());
  });
}
