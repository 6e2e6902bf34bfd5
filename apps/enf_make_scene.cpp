// enf-make-scene: writes a synthetic scene with exact ground truth as a scene folder.
#include <fmt/ranges.h>

#include <cstdio>
#include <filesystem>
#include <string>

#include "libeditnerf/base/error.h"
#include "libeditnerf/base/logging.h"
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
  return editnerf::RunProgram(
      "enf-make-scene",
      fmt::format("Writes a synthetic scene with exact ground truth: {}.",
                  fmt::join(editnerf::SyntheticSceneNames(), ", ")),
      argc, argv,
      [&](CLI::App& app) {
        app.add_option("NAME", name, "which scene")->required();
        app.add_option("--out", out, "scene folder to write")->required();
        app.add_option("--frames", options.frames, "training frames")->capture_default_str();
        app.add_option("--val-frames", options.val_frames, "known states from new cameras")->capture_default_str();
        app.add_option("--edit-frames", options.edit_frames, "states that training never shows")->capture_default_str();
        app.add_option("--slide-frames", options.slide_frames,
                       "and states of one part on a straight line, by one camera")
            ->capture_default_str();
        app.add_option("--size", size, "WIDTHxHEIGHT in pixels")->capture_default_str();
        app.add_option("--samples", options.samples_per_side, "antialiasing samples per pixel side")
            ->capture_default_str();
      },
      [&](const editnerf::CommonOptions& common) {
        ParseSize(size, &options);
        options.seed = static_cast<uint64_t>(common.seed);
        editnerf::WriteSceneFolder(editnerf::MakeSyntheticScene(name, options), out);
        editnerf::LogInfo("wrote {}", out.string());
      });
}
