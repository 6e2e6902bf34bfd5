// enf-render RUN --out PATH: pictures or a video of a run: its frames, a camera path, an edit.
#include <cstdio>
#include <filesystem>

#include "libeditnerf/base/error.h"
#include "libeditnerf/base/file.h"
#include "libeditnerf/base/logging.h"
#include "libeditnerf/pipeline/demo_edit.h"
#include "libeditnerf/pipeline/rendering.h"
#include "support/run.h"

namespace {

struct Request {
  std::filesystem::path run, camera_path, edit, write_edit;
  std::string frames, code_frame, size;
  bool demo_edit = false;
  editnerf::RenderOutput output;
};

// "320x180".
void ParseSize(const std::string& text, editnerf::RenderOutput* output) {
  long long width = 0, height = 0;
  int used = 0;
  if (std::sscanf(text.c_str(), "%lldx%lld%n", &width, &height, &used) != 2 ||
      text.size() != static_cast<size_t>(used) || width < 1 || height < 1 || width > 65536 || height > 65536) {
    editnerf::Throw<editnerf::ConfigError>("--size: expected WIDTHxHEIGHT such as 320x180, found '{}'", text);
  }
  output->width = width;
  output->height = height;
}

void Define(CLI::App& app, Request& request) {
  app.add_option("RUN", request.run, "run folder")->required();
  app.add_option("--out", request.output.path, "an .mp4 file, or a folder for PNG files")->required();
  CLI::Option_group* const source = app.add_option_group("source", "what to render; exactly one of");
  source->add_option("--frames", request.frames, "train, val, all, or ids separated by commas");
  CLI::Option* const path = source->add_option("--camera-path", request.camera_path, "folder of camera files");
  source->add_option("--edit", request.edit, "edit file (docs/edit-files.md)");
  CLI::Option* const demo = source->add_flag("--demo-edit", request.demo_edit, "every key point along its own way");
  source->require_option(1);
  app.add_option("--code-frame", request.code_frame, "frame whose state a camera path shows; the middle one by default")
      ->needs(path);
  app.add_option("--write-edit", request.write_edit, "where to write the demo edit's file")->needs(demo);
  app.add_flag("--depth", request.output.depth, "depth pictures as well");
  app.add_flag("--weights", request.output.weights, "key point weights as pictures as well");
  app.add_option("--size", request.size, "WIDTHxHEIGHT in pixels; by default as the cameras say");
  app.add_option("--fps", request.output.fps, "of a video; by default as the edit says, or 24")
      ->check(CLI::PositiveNumber);
}

editnerf::RenderJob Plan(const Request& request, const editnerf::Run& run) {
  if (!request.frames.empty()) return editnerf::PlanFrames(run, request.frames);
  if (!request.camera_path.empty()) return editnerf::PlanCameraPath(run, request.camera_path, request.code_frame);
  if (!request.edit.empty()) return editnerf::PlanEdit(run, editnerf::ReadEditFile(request.edit));
  const editnerf::EditFile demo = editnerf::MakeDemoEdit(run);
  if (!request.write_edit.empty()) {
    editnerf::WriteFileAtomically(request.write_edit, editnerf::WriteEditFile(demo));
  }
  return editnerf::PlanEdit(run, demo);
}

}  // namespace

int main(int argc, char** argv) {
  Request request;
  return editnerf::RunProgram(
      "enf-render", "Renders pictures or a video of a run.", argc, argv, [&](CLI::App& app) { Define(app, request); },
      [&](const editnerf::CommonOptions& common) {
        if (!request.size.empty()) ParseSize(request.size, &request.output);
        if (common.config_given || !common.overrides.empty()) {
          editnerf::LogWarning("a run is rendered as it was trained: --config and --set change nothing here");
        }
        const editnerf::Run run = editnerf::LoadRun(request.run, common.device);
        editnerf::RenderFrames(run, Plan(request, run), request.output);
      });
}
