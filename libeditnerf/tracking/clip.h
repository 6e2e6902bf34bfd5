// The training sequence as the trackers see it: cameras, images, depth maps and checked flow, one entry per frame.
#pragma once

#include <torch/types.h>

#include <map>
#include <utility>
#include <vector>

#include "libeditnerf/scene/scene.h"
#include "libeditnerf/tracking/flow_sequence.h"
#include "libeditnerf/tracking/map_lookup.h"

namespace editnerf {

struct Clip {
  std::vector<Camera> cameras;        // T, scene units
  std::vector<torch::Tensor> images;  // T times [H, W, 3] uint8
  std::vector<torch::Tensor> gray;    // T times [H, W] float32, 0 to 255
  std::vector<torch::Tensor> depth;   // T times [H, W] float32, distance along the ray, scene units; NaN: no surface
  std::vector<torch::Tensor> forward, backward;              // T-1 times [H, W, 2] float32
  std::vector<torch::Tensor> forward_valid, backward_valid;  // T-1 times [H, W] bool
  int64_t width = 0, height = 0;

  int64_t num_frames() const { return static_cast<int64_t>(cameras.size()); }
  double PixelScale() const { return static_cast<double>(width) / 320.0; }  // pixels here per pixel at 320 wide
  bool Inside(const Pixel& p) const { return InsideImage(p, width, height); }

  // Flow from frame t to t + step at a position, step = 1 or -1; invalid beyond the sequence.
  FlowSample Step(int64_t t, int64_t step, const Pixel& p) const;

  // The scene point at a distance along the ray through a position in frame t.
  Vec3 Lift(int64_t t, const Pixel& p, double distance) const;
};

// `depth` [T, H, W] as in PretrainedMaps. Shares memory with its inputs where they are contiguous.
// Throws ShapeError unless depth and flows fit the training frames.
Clip MakeClip(const Scene& scene, const torch::Tensor& depth, const FlowSequence& flows);

// Flow between distant frames, computed when asked for and kept, as far as memory is meant for it. Not thread-safe.
class DirectFlows {
 public:
  DirectFlows(const Clip& clip, const OpticalFlow& flow) : clip_(clip), flow_(flow) {}

  // Where position p of frame `from` lies in frame `to`, and the distance in pixels between p and the position that the
  // flow back from there gives: the forward-backward error. `valid` is false where either look-up fails.
  struct Match {
    Pixel pixel;
    double error = 0;
    bool valid = false;
  };
  Match Find(int64_t from, int64_t to, const Pixel& p);

 private:
  const torch::Tensor& Get(int64_t from, int64_t to);

  const Clip& clip_;
  const OpticalFlow& flow_;
  std::map<std::pair<int64_t, int64_t>, torch::Tensor> cache_;
};

}  // namespace editnerf
