// Centre, scale, near and far of a scene from what structure from motion (or another source) knows about it.
#pragma once

#include "libeditnerf/imaging/importers/imported_model.h"
#include "libeditnerf/scene/scene.h"

namespace editnerf {

// With points: the box around the points (2.5th to 97.5th percentile along each axis) and the camera centres gets a
// diagonal of 1 and its middle becomes the origin, as Nerfies does. near and far are percentiles of the distances from
// each camera to the points that it observed, widened: what moves has no points and may be nearer than all of them.
// Without points: each frame's near and far bound what it sees; without those, the camera centres and the point that
// all cameras look at do. Throws DataError where nothing determines the scene's size (all cameras in one place).
SceneTransform EstimateSceneTransform(const ImportedModel& model);

}  // namespace editnerf
