// Candidates for key points, and which of them stay (key_point_detection.h has the rules and the reasons).
#pragma once

#include <string>
#include <vector>

#include "libeditnerf/config/config.h"
#include "libeditnerf/tracking/propagation.h"
#include "libeditnerf/tracking/surface_volume.h"
#include "libeditnerf/tracking/track_relation.h"

namespace editnerf {

// Where a candidate's track starts.
struct TrackStart {
  int64_t frame = 0;
  Pixel pixel;
  double distance = 0;  // scene units, of the surface
  double motion = 0;    // evidence there
};

struct Candidate {
  VolumeMaximum maximum;
  TrackStart start;
  PixelTrack pixels;
  PointTrack track, refined;
  TrackMotion motion;              // of the refined track, with the noise of the other
  bool on_static_surface = false;  // all along its track
  int64_t moving = 0;              // visible frames with evidence of motion
  double camera_strength = 0;      // upper quartile of what the camera explains, pixels a frame
  std::vector<Pixel> own_motion;   // T - 1, in the image beyond what the camera explains; NaN where not visible
  int64_t part = -1;               // which rigid part carries it (part_candidates.h); -1: none
  std::vector<Vec3> turns;         // T rotation vectors of that part; empty where it does not turn
  std::string objection;           // why it is no key point of its own; empty for those that are
};

// "(x, y, z)" for notes.
std::string Place(const Vec3& p);

// The value that a quarter of all exceed; 0 without any.
double UpperQuartile(std::vector<double> values);

// These give objections to candidates that have none:
// those that hardly move, beside the strongest or beside what the camera causes: shadows and what lies around moving
// parts, whose flow is disturbed, also differ from the static scene. `pixel_scale`: pixels per pixel at 320 wide;
void RejectWeakMotion(std::vector<Candidate>* candidates, double pixel_scale);
// what moves on static surfaces, as shadows do, where other candidates have surfaces of their own;
void RejectShadows(std::vector<Candidate>* candidates);
// those on the same part as another one. The one whose depth is known in most frames stays: it needs the least
// guessing.
void MergeDuplicates(std::vector<Candidate>* candidates, double merge_distance);

// The candidates to keep, strongest first; `notes` says what became of the others. With config.count given, candidates
// with objections fill it up. Throws ConfigError where there are too few.
std::vector<const Candidate*> SelectCandidates(const std::vector<Candidate>& candidates, const DetectionConfig& config,
                                               std::vector<std::string>* notes);

}  // namespace editnerf
