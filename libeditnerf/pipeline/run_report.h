// The report of a whole way: scores, error against time, pictures, the edited video.
#pragma once

#include <torch/types.h>

#include <filesystem>
#include <string>

#include "libeditnerf/scene/scene.h"

namespace editnerf {

// Reads WORK (pipeline/whole_way.h) and writes WORK/report: index.html, scores.json, edited.mp4, edit.json, strip.png.
void WriteRunReport(const std::filesystem::path& work, const Scene& scene, torch::Device device,
                    const std::string& command);

}  // namespace editnerf
