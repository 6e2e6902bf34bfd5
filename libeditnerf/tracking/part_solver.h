// Least squares over a rigid part: bundle adjustment with the cameras known and the body moving.
#pragma once

#include <cstdint>
#include <optional>
#include <vector>

#include "libeditnerf/tracking/clip.h"
#include "libeditnerf/tracking/flow_tracks.h"
#include "libeditnerf/tracking/rigid_part.h"

namespace editnerf {

// Standard deviations; pixels refer to an image 320 wide and become scene units at the part's distance. Shifts and
// turns count by their length, not its square: a part rests, or it moves. That also settles how far it is: at a wrong
// distance it would have to follow the camera.
struct PartSolverOptions {
  double flow_pixels = 1.0;          // of a tracked pixel
  double acceleration_pixels = 2.0;  // of the part's centre, a frame and frame
  double shift_pixels = 1.0;         // of the part's centre, a frame
  double turn = 0.05;                // radians a frame
  double rest_pixels = 0;            // of way a frame up to which the part is taken to rest; 0: it never is
  double shape = 0.15;               // of a point from the part's centre, as a share of the part's distance
  bool hold_scale = false;           // whether it stays as far from the cameras as it was, if nothing holds it
  int iterations = 25;
};

double DistanceOf(const Clip& clip, const RigidPart& part);  // from its reference frame's camera, scene units
double PixelAt(const Clip& clip, double distance);           // scene units of a pixel at 320 wide

// Frame t's pose alone, from the part's points seen there; begins from the pose that is there. `towards`: a frame from
// whose rotation it should differ by little. False where fewer than three pixels are known or nothing finite comes out.
bool SolvePose(const Clip& clip, const std::vector<FlowTrack>& tracks, const PartSolverOptions& options, int64_t t,
               int64_t towards, RigidPart* part);

// The poses of the given frames, in time order, and all points; the reference frame's pose stays, and rotations do of a
// part that does not turn. Returns the cost that
// is left (half the sum of squares), comparable among starts from the same tracks and frames; empty where fewer than
// three pixels are known or nothing finite comes out.
std::optional<double> SolvePart(const Clip& clip, const std::vector<FlowTrack>& tracks,
                                const PartSolverOptions& options, const std::vector<int64_t>& frames, RigidPart* part);

}  // namespace editnerf
