// Flow of a sequence kept in a file, where it is dear: what pretraining's depth from flow computed, detection reads.
#pragma once

#include <torch/types.h>

#include <filesystem>

#include "libeditnerf/tracking/flow_sequence.h"

namespace editnerf {

// The flow of images [T, H, W, 3] (ComputeFlowSequence, without a guess), from the file at `path` if that was made from
// the same images by the same flow (OpticalFlow::Identity), otherwise computed and, with `keep`, written there. A file
// that cannot be read is named in a warning and replaced.
FlowSequence CachedFlowSequence(const torch::Tensor& images, const OpticalFlow& flow, const std::filesystem::path& path,
                                bool keep = true);

// Where a run folder keeps it.
std::filesystem::path FlowCachePath(const std::filesystem::path& run_folder);

}  // namespace editnerf
