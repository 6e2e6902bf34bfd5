// Key points of a scene, found from the pretrained field and the images: where, how many, and their initial tracks.
//
// By default every rigid part that moves gets one (moving_parts.h, part_candidates.h). detect.rigid_parts: false looks
// for them where the paper does, at the maxima of the variance volume (volume_candidates.h); beside parts the maxima
// count where more key points are asked for than there are parts. The volume is built in any case, for the pictures.
#pragma once

#include <torch/types.h>

#include <string>
#include <vector>

#include "libeditnerf/config/config.h"
#include "libeditnerf/scene/scene.h"
#include "libeditnerf/tracking/flow_sequence.h"
#include "libeditnerf/tracking/motion_evidence.h"
#include "libeditnerf/tracking/pretrained_maps.h"
#include "libeditnerf/tracking/propagation.h"
#include "libeditnerf/tracking/surface_volume.h"
#include "libeditnerf/training/depth_targets.h"

namespace editnerf {

// T training frames, N key points, strongest first.
struct Detection {
  torch::Tensor reference;                // [N, 3] float32, scene units, on the surface of its reference frame
  std::vector<int64_t> reference_frame;   // N, row of scene.train
  torch::Tensor tracks;                   // [T, N, 3] float32, scene units; frames without evidence interpolated
  torch::Tensor visible;                  // [T, N] bool: checked flow leads here and the depth map agrees
  torch::Tensor turns;                    // [T, N, 3] float32, rotation vectors of the parts; undefined: none turns
  torch::Tensor score;                    // [N] float32, the part's weight, or the smoothed variance at the maximum
  std::vector<PixelTrack> pixel_tracks;   // N, what the tracks were lifted from
  std::vector<bool> rigid;                // N, whether a rigid part carries the track: nothing is left to refine
  DepthTargets part_depth;                // distances on those parts
  std::vector<std::string> notes;         // what was dropped or merged and why, for the report
  SurfaceVolume volume;                   // for pictures
  MotionEvidence motion;                  // likewise
  std::vector<VolumeMaximum> candidates;  // all maxima, strongest first

  int64_t count() const { return static_cast<int64_t>(reference_frame.size()); }
};

// `flow` supplies direct flow for skips. config.count > 0 forces that number: candidates that were dropped or merged
// come back in the order of their strength, with a note. No moving part is not an error: count() is then 0 and a note
// says so. Throws DataError when the maps do not fit the scene or hold no surface, ConfigError when more key points are
// forced than there are candidates.
Detection DetectKeyPoints(const Scene& scene, const PretrainedMaps& maps, const FlowSequence& flows,
                          const OpticalFlow& flow, const DetectionConfig& config);

}  // namespace editnerf
