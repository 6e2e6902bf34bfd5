// Synthetic scenes with exact ground truth, drawn by an analytic ray tracer: the fixtures of the tests and the clips of
// the demonstration. docs/synthetic-scenes.md shows what each is for.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "libeditnerf/scene/scene.h"

namespace editnerf {

struct SyntheticOptions {
  int64_t frames = 120;               // training frames, >= 2: one monocular sequence in time order
  int64_t val_frames = 16;            // object states of training frames, seen from new cameras
  int64_t edit_frames = 16;           // object states that no training frame shows; none in a scene where nothing moves
  int64_t slide_frames = 0;           // edit frames as well, the last ones: one part on a line, seen by one camera
  int64_t width = 320, height = 180;  // pixels, >= 8
  int64_t samples_per_side = 4;       // antialiasing grid per pixel side, 1..16; flat pixels take fewer
  uint64_t seed = 0;                  // of the camera's wandering, the edits, the shadows' noise, and all of a medley
};

// "hinge": a chest whose lid turns on a hinge; object "lid".
// "keys": a ball on a stick moves in all three dimensions and presses the keys of a small piano; objects "hammer",
//   "key_0" .. "key_4".
// "cups": two cups that slide and lift off the ground independently; objects "cup_left", "cup_right".
// "cabinet": a door that turns, a drawer that slides, and a lantern that rises behind them; objects "door", "drawer",
//   "lantern".
// "static": nothing moves; no objects.
// "medley": one to three parts drawn by lot from the seed; objects "part_0_slides" and the like, or roams, rises,
// turns.
std::vector<std::string> SyntheticSceneNames();

// A complete scene with truth and background points. Frame ids are six digits; training frames come first, then
// validation frames (warp_id and appearance_id of the training frame whose state they show), then edit frames (-1).
// The same options give the same scene, whatever the number of threads.
// Throws ConfigError naming the known names for an unknown one, or the option that is out of range.
Scene MakeSyntheticScene(const std::string& name, const SyntheticOptions& options);

}  // namespace editnerf
