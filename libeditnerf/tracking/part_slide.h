// A rigid part that slides: it does not turn, and goes along one straight line (a rail), or on one plane, that stands
// still in the scene. Drawers, lifts and sliding doors move along a line, and what is pushed about on a table on a
// plane. Where that explains the tracks it says what free motion leaves open: how far the part is, as at any other
// distance it would have to follow the camera (which tells nothing of a plane along which the camera goes, too), and
// the slow drift off the line or plane that free motion makes of patches which slide by a fraction of a pixel while the
// camera goes around.
#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <vector>

#include "libeditnerf/tracking/part_solver.h"

namespace editnerf {

struct Slide {
  int freedom = 1;                           // 1: along the first axis; 2: along the first two
  std::array<Vec3, 3> axes;                  // orthonormal
  std::vector<std::array<double, 2>> place;  // T: along the first two axes, scene units from the reference frame
};

// The line or plane nearest to the part's translations in the given frames; empty where they hardly differ, for a plane
// also in one direction alone.
std::optional<Slide> NearestSlide(const RigidPart& part, const std::vector<int64_t>& frames, int freedom);

// Sets the poses of the given frames to those of the slide.
void SetPoses(const Slide& slide, const std::vector<int64_t>& frames, RigidPart* part);

// As SolveHinge (part_hinge.h): the line or plane and all points by least squares over the given frames, in time order.
std::optional<double> SolveSlide(const Clip& clip, const std::vector<FlowTrack>& tracks,
                                 const PartSolverOptions& options, const std::vector<int64_t>& frames, Slide* slide,
                                 RigidPart* part);

// Of a part on a rail or a plane: sets the poses of frames that do not see it (FillBetween, rigid_part.h).
void FillPlaces(RigidPart* part);

// 1 on a rail, 2 on a plane.
int FreedomOf(PartMotion motion);

}  // namespace editnerf
