// enf INPUT --out WORK: the whole way, from a video to an editable scene.
#include "libeditnerf/pipeline/whole_way.h"

#include <fmt/ranges.h>

#include <vector>

#include "support/run.h"

int main(int argc, char** argv) {
  editnerf::WholeWayRequest request;
  return editnerf::RunProgram(
      "enf", "Turns a video from one moving camera into a scene that is edited by dragging key points.", argc, argv,
      [&](CLI::App& app) {
        app.add_option("INPUT", request.input, "video, folder of images, or scene folder")->required();
        app.add_option("--out", request.work, "folder for everything that is made")->required();
        app.add_option("--time-budget", request.time_budget,
                       "seconds for what is still to do; where COLMAP finds the poses, at "
                       "least 60 % of them come after it")
            ->check(CLI::PositiveNumber);
        app.add_option("--max-frames", request.max_frames, "frames taken of a video, evenly spaced")
            ->check(CLI::PositiveNumber)
            ->capture_default_str();
      },
      [&](const editnerf::CommonOptions& common) {
        request.config = common.config;
        request.device = common.device;
        request.seed = common.seed;
        request.threads = common.threads;
        request.command = fmt::format("{}", fmt::join(std::vector<std::string>(argv, argv + argc), " "));
        editnerf::RunWholeWay(request);
      });
}
