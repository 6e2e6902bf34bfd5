// Key points of a scene, found from the pretrained field and the images: where, how many, and their initial tracks.
//
// EditableNeRF (Zheng et al., CVPR 2023), section 3.3: maxima of the variance volume (surface_volume.h) are the
// candidates k_ref; each gets a reference frame in which it lies on the surface,
//   | Phi_t(k_ref) - D_t(Pi_t(k_ref)) | < delta Phi_t(k_ref),  k_ref inside the image,
// is propagated from there by optical flow (propagation.h), and goes back to 3-D with the depth maps.
//
// Where this departs from the paper:
// - The paper takes the first such frame. But a voxel of the swept volume at the height of the floor, or of
//   whatever the part slides along, is "on a surface" also while the part is elsewhere, and a track that starts
//   on the floor stays there. So frames are preferred whose surface there moves against the static scene
//   (motion_evidence.h); of the best few the one whose track moves and stays visible longest is taken. Only
//   where no frame shows motion the paper's rule decides.
// - k_ref is moved onto the nearest surface point of its reference frame: voxel centres lie up to a voxel off.
//   Points away from depth edges are preferred, because flow is unreliable there.
// - While a part moves, its depth map is a guess (the monocular ambiguity), often the background's. Depths at
//   which most other frames see the static scene are not used; the track is carried over them.
// - Dropped are candidates whose tracks move by no more than noise; that move in the image, beyond what the
//   camera explains, by little beside the strongest or beside the camera's own share; and those on static
//   surfaces all along, such as shadows.
// - Of candidates on one part the one whose depth is known in most frames stays (the paper's supplement:
//   duplicates on one object have very similar tracks). Two tracks belong to one part when they move together
//   in the image, or when their distance stays constant up to merge_distance times their motion range while
//   they move at the same times (a lid's two points move by different amounts, but together).
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
  torch::Tensor score;                    // [N] float32, smoothed variance at the maximum
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
