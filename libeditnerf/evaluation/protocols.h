// What is shown in which frame of the evaluation: the parts of the protocols that need no rendering.
//
// - Reconstruction: validation frames whose object state (warp id) training saw from another camera.
// - Interpolation: validation frames of a state between two training frames; codes and key points are blended.
// - Editing: object states that training never saw. Key points follow the true motion of the object that they lie on,
//     k(t) = M(t) M(t_ref)^-1 k_ref          M = scene_from_object of the ground truth
//   and the codes are those of the training frame with the nearest key points.
//
// All positions in scene units; frames are indices into Scene::frames, "train indices" into Scene::train.
#pragma once

#include <torch/types.h>

#include <cstdint>
#include <vector>

#include "libeditnerf/scene/scene.h"

namespace editnerf {

constexpr int64_t kStaticObject = -1;

// A detected key point in the frame in which it was found.
struct ReferenceKeyPoint {
  Vec3 position;  // in that frame
  int64_t frame = 0;
  int64_t object = kStaticObject;  // of GroundTruth::objects, see ObjectAt
};

// Whether the scene has the ground-truth mask by which objects are told apart.
bool HasMasks(const Scene& scene);

// The moving object seen at the key point's pixel (its projection rounded down) by the ground-truth mask; kStaticObject
// on the static scene, outside the image and behind the camera. Throws DataError when the scene has no ground truth.
int64_t ObjectAt(const Scene& scene, int64_t frame, const Vec3& position);

// The key points with their objects: positions [N, 3], reference frames N.
std::vector<ReferenceKeyPoint> WithObjects(const Scene& scene, const torch::Tensor& positions,
                                           const std::vector<int64_t>& frames);

// Where the key points truly are in a frame: [N, 3] float64. One on a static object stays.
torch::Tensor TrueKeyPoints(const Scene& scene, const std::vector<ReferenceKeyPoint>& key_points, int64_t frame);

struct NearestFrame {
  int64_t train_index = 0;
  double distance = 0;  // root mean square over the key points
};

// The row of tracks [T, N, 3] (one per training frame) nearest to key_points [N, 3]; the first of equals. N >= 1.
NearestFrame NearestTrainingFrame(const torch::Tensor& tracks, const torch::Tensor& key_points);

}  // namespace editnerf
