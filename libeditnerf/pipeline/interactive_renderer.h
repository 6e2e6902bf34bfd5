// Pictures of a run while somebody drags its key points: quick ones first, and the same bytes again for the same state.
#pragma once

#include <torch/types.h>

#include <cstdint>
#include <functional>
#include <list>
#include <string>
#include <vector>

#include "libeditnerf/field/radiance_field.h"
#include "libeditnerf/geometry/camera.h"
#include "libeditnerf/training/run.h"

namespace editnerf {

struct PictureRequest {
  std::vector<Vec3> key_points;  // all of the run's, scene units
  int64_t row = 0;               // of the training frames: whose codes are used
  Camera camera;                 // scene units
  int64_t width = 0;             // pixels, the height follows; 0: as the camera says
  double weights = 0;            // how much of the key points' colours, mixed by their weights, lies over it; [0, 1]
  bool preview = false;          // half the steps along rays; passing as well
  bool passing = false;          // not kept; room is made (below) only more than a cell from any known state
};

// Not thread-safe: all calls from one thread, which keeps LibTorch's own threads few as well.
class InteractiveRenderer {
 public:
  explicit InteractiveRenderer(Run run);

  // uint8 [H, W, 3] on the CPU; undefined where `stop`, asked between strips of the picture, said so. `stop` may render
  // other pictures meanwhile.
  //
  // Occupancy grids are widened for a state when one of its key points is farther than half a cell from every place
  // where this key point is known to have been, in training or in an earlier picture. That a key point makes
  // room for itself wherever the others are is not exact, but what it leaves out is below the grids' own dilation. A
  // picture that was made with narrower grids can differ in its faintest parts; pictures that are not passing are
  // therefore kept for a while, so that a state that is undone shows exactly what it showed before.
  torch::Tensor Render(const PictureRequest& request, const std::function<bool()>& stop = {});

  const Run& run() const { return run_; }

 private:
  struct Kept {
    std::string key;
    torch::Tensor picture;
  };

  FrameStates StatesOf(const PictureRequest& request) const;
  void MakeRoom(const PictureRequest& request, const FrameStates& states);
  torch::Tensor RenderStrips(const PictureRequest& request, const FrameStates& states,
                             const std::function<bool()>& stop) const;

  Run run_;
  double cell_ = 0;                       // of the occupancy grid, scene units; 0: there is none
  std::vector<std::vector<Vec3>> known_;  // [N]: places that the grids have room for
  std::list<Kept> kept_;                  // the latest first
  int64_t kept_bytes_ = 0;
};

}  // namespace editnerf
