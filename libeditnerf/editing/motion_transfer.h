// Driving a key point by what moves in a picture: an affine map from pixels into the key point's space.
//
//   k(u, v) = offset + u * along_u + v * along_v
//
// It is fitted to pairs of a pixel and a position (FitPairs), or lays the range of the one motion onto the range of the
// other (FitRanges). Everything is in scene units and pixels of the driving video.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "libeditnerf/editing/edit_file.h"
#include "libeditnerf/editing/key_point_tracks.h"
#include "libeditnerf/editing/point_track.h"
#include "libeditnerf/geometry/camera.h"
#include "libeditnerf/geometry/vec3.h"
#include "libeditnerf/scene/scene.h"

namespace editnerf {

struct AffineMotion {
  Vec3 offset, along_u, along_v;
  int64_t rank = 0;  // directions of the image that have an effect: 1 where all that was known lay on a line

  Vec3 At(const Pixel& p) const { return offset + along_u * p.u + along_v * p.v; }
};

// Least squares over pairs, of which there are as many in both lists. Where all pixels lie on a line (as two always
// do), motion across it has no effect. Throws DataError for fewer than two pairs, and where all pixels coincide.
AffineMotion FitPairs(const std::vector<Pixel>& pixels, const std::vector<Vec3>& positions);

// The middle of the pixels' range to the middle of the positions', the longest principal axis to the longest with its
// whole length, and the second to the second where both motions have one (a twentieth of the first or more). An axis is
// turned to the side to which `view` sees the key point go when the pixel goes there; `reversed` turns the first the
// other way, and `axes` 1 leaves the second out. Throws DataError where the pixels stay within half a pixel, or the
// positions in one place.
AffineMotion FitRanges(const std::vector<Pixel>& pixels, const std::vector<Vec3>& positions, const Camera& view,
                       bool reversed = false, int64_t axes = 2);

// A frame of the video and the training row in which the key point is in the same state.
struct FramePair {
  int64_t video_frame = 0, row = 0;
};

struct TransferOptions {
  int64_t key_point = 0;         // numbered from 0
  std::vector<FramePair> pairs;  // none: by range
  bool reversed = false;         // by range: the other way round
  int64_t axes = 2;              // by range: 1 leaves the second axis out
  Camera view;                   // by range: which side is which; scene units
};

// Throws DataError for a key point that does not exist.
void CheckKeyPoint(const KeyPointTracks& tracks, int64_t key_point);

// Where the key point goes, one position for each of the track's. Throws DataError as the fits do, and for key points,
// video frames and rows that do not exist.
std::vector<Vec3> TransferMotion(const PointTrack& track, const KeyPointTracks& tracks, const TransferOptions& options);

// The edit in which one key point follows the positions; all else, and the codes, stay as in the training frame
// `code_frame`, seen from the frame `camera_frame` (ids).
EditFile DrivenEdit(const std::vector<Vec3>& positions, int64_t key_point, double fps, const std::string& code_frame,
                    const std::string& camera_frame);

}  // namespace editnerf
