// Candidates for key points where the paper looks for them: the maxima of the variance volume.
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

#include <string>
#include <vector>

#include "libeditnerf/config/config.h"
#include "libeditnerf/tracking/candidates.h"
#include "libeditnerf/tracking/clip.h"
#include "libeditnerf/tracking/motion_evidence.h"
#include "libeditnerf/tracking/still_points.h"
#include "libeditnerf/tracking/surface_volume.h"

namespace editnerf {

// A few maxima for every key point that may be kept, strongest first, each with its objection if it has one; `notes`
// says which maxima no frame sees. range: scene units, of the scene. Throws Interrupted.
std::vector<Candidate> VolumeCandidates(const Clip& clip, DirectFlows* direct, const MotionEvidence& motion,
                                        const DepthRange& range, const std::vector<VolumeMaximum>& maxima,
                                        double voxel_size, const DetectionConfig& config,
                                        std::vector<std::string>* notes);

}  // namespace editnerf
