// Robust least-squares smoothing of the key points' initial tracks, before training.
//
// For each key point the positions k_t of all T frames minimise, with a robust loss rho on every term,
//   motion      | Pi_{t+1}(k_{t+1}) - Pi_t(k_t) - F_t^{t+1}(Pi_t(k_t)) |   L_motion of EditableNeRF (CVPR 2023), pixels
//   geometry    | Phi_t(k_t) - D_t(Pi_t(k_t)) |                            L_geo, scene units
//   skip        | Pi_t(k_t) - q_t |,  q_t by direct flow from t_ref        the links that propagation took, pixels
//   smoothness  | k_{t-1} - 2 k_t + k_{t+1} |                              scene units
//   anchor      | k_tref - k_ref |, and weakly | k_t - initial k_t |
//
// each divided by its standard deviation (below). Motion, geometry and skip terms exist only where there is evidence;
// where there is none the smoothness term, stiffened there, carries the track, a weak geometry term holds the distance
// of the initial track, and the anchors keep every problem determined, whatever is missing.
#pragma once

#include <torch/types.h>

#include <string>
#include <vector>

#include "libeditnerf/tracking/clip.h"
#include "libeditnerf/tracking/key_point_detection.h"
#include "libeditnerf/tracking/track_relation.h"

namespace editnerf {

// Pixels refer to an image 320 wide; they become scene units at the track's median distance.
struct RefinementOptions {
  double motion_pixels = 0.5;
  double skip_pixels = 1.5;
  double depth_share = 0.003;        // least deviation of D_t, of the depth; more where the track's own noise says so
  double guessed_depth_share = 0.1;  // of the initial track's distance where there is no D_t
  double smoothness_pixels = 1.0;    // acceleration per frame^2 where visible
  double unseen_smoothness = 0.3;    // times that where a frame has no evidence
  double anchor_pixels = 0.5;        // at the reference frame
  double prior_pixels = 30.0;        // elsewhere
  int64_t rounds = 2;                // depths are looked up anew before each
};

// Root mean squares over the terms that exist; 0 where there are none.
struct TrackResiduals {
  double motion = 0;    // pixels of the clip
  double geometry = 0;  // scene units
  double skip = 0;      // pixels of the clip
  int64_t motion_terms = 0, geometry_terms = 0, skip_terms = 0;
};

struct RefinedTrack {
  std::vector<Vec3> position;    // T, scene units
  TrackResiduals before, after;  // with the same terms
  std::string note;              // empty, or why the track was left as it was
};

RefinedTrack RefineTrack(const Clip& clip, const PointTrack& initial, const PixelTrack& pixels,
                         const RefinementOptions& options = {});

// Replaces detection->tracks by the refined ones (references stay); notes are appended. One entry per key point.
std::vector<RefinedTrack> RefineTracks(const Clip& clip, Detection* detection, const RefinementOptions& options = {});

}  // namespace editnerf
