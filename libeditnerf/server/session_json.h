// Edit sessions in JSON, as the page sees them (docs/editor.md lists the operations).
#pragma once

#include <string>

#include "libeditnerf/editing/edit_session.h"
#include "libeditnerf/imaging/json_file.h"
#include "libeditnerf/server/motion_job.h"

namespace editnerf {

// What stays the same: cameras, sparse points, trajectories, box, frames, colours.
Json SceneToPageJson(const EditableScene& scene, const std::string& title);

// What changes: key points as the picture shows them, camera, frame, undo, trail.
Json SessionToPageJson(const EditSession& session);

// How a video's point is getting on, and where it takes the key point.
Json MotionToPageJson(const MotionStatus& status);

// One operation, {"do": "move", "key_point": 0, "u": 12.5, "v": 8, "gesture": 3}. `where` starts the messages. Throws
// DataError for an unknown operation, a missing or wrong argument, and as the session does.
void ApplyOperation(const Json& operation, const std::string& where, EditSession* session);

}  // namespace editnerf
