// Nothing moves: what the moving-part machinery must leave alone.
#include "libeditnerf/scene/synthetic/stage.h"

namespace editnerf::synthetic {

Play StaticPlay() {
  using Pattern = Texture::Pattern;
  Play play;
  play.bodies = {
      Studio({0.34, 0.44, 0.48}, {0.52, 0.44, 0.34}),
      Block({0, 0.1, 0}, {0.45, 0.32, 0.08}, 0.25, {Pattern::kStripes, {0.60, 0.15, 0.12}, {0.9, 0.8, 0.6}, 0.07, 21}),
      Block({0.03, 0.1, 0.16}, {0.38, 0.27, 0.06}, 0.05,
            {Pattern::kMosaic, {0.1, 0.3, 0.5}, {0.4, 0.6, 0.8}, 0.09, 22, 0.2}),
      Block({-0.02, 0.1, 0.28}, {0.3, 0.22, 0.05}, 0.4,
            {Pattern::kWood, {0.35, 0.2, 0.08}, {0.75, 0.5, 0.25}, 0.04, 23}),
      Vase({0.0, 0.1, 0.38}, 0.2, 0.55, {Pattern::kDots, {0.85, 0.8, 0.7}, {0.15, 0.3, 0.6}, 0.09, 24, 0.4}),
      Ball({-0.85, -0.1, 0}, 0.24, {Pattern::kChecker, {0.75, 0.3, 0.1}, {0.95, 0.88, 0.7}, 0.12, 25}),
      Ball({0.55, -0.55, 0}, 0.13, {Pattern::kMosaic, {0.2, 0.5, 0.2}, {0.6, 0.7, 0.2}, 0.07, 26, 0.4}),
      Cone({0.9, 0.25, 0}, 0.22, 0.6, {Pattern::kDots, {0.45, 0.15, 0.4}, {0.95, 0.85, 0.4}, 0.09, 27, 0.3}),
      Block({-0.6, 0.8, 0}, {0.2, 0.15, 0.3}, 0.6, {Pattern::kChecker, {0.2, 0.4, 0.35}, {0.85, 0.85, 0.7}, 0.1, 28})};
  play.poses = [](const State&) { return std::vector<Pose>{}; };
  play.camera.focus = {0, 0.05, 0.42};
  return play;
}

}  // namespace editnerf::synthetic
