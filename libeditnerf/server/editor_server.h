// The browser editor's server: one page, and what the page asks for (docs/editor.md).
//
//   GET    /                   the page
//   GET    api/scene           cameras, trajectories, colours
//   POST   api/edit            {"tab", "operations": [...], "picture": {"width", "weights", "preview"}}
//                              -> {"state", "picture": {"width", "height", "type", "data" (base64), "milliseconds"},
//                              "fresh"}; "picture" is null where none was asked for, or a newer request of the tab
//                              overtook it; "fresh" is true in the first answer to a tab that the server did not know
//   GET    api/trail           the tab's trail as an edit file (docs/edit-files.md); tab, fps
//   POST   api/video           {"tab", "fps", "width"}: renders the tab's trail in the background; 409 while another
//                              video is being rendered
//   GET    api/video           ?tab -> {"state", "done", "total", "message"} of the tab's video; here and below,
//                              without a tab: of the one that was started last
//   DELETE api/video           ?tab: cancels it
//   GET    api/video/file      ?tab: the MP4
//   POST   api/motion/video    ?tab, offset, size (of the whole), last (0 or 1): bytes of the video that is to drive a
//                              key point; the last piece -> {"width", "height", "picture"}, its first frame
//   POST   api/motion          {"tab", "u", "v", "key_point", "reversed", "axes", "pairs"}: follows the point in the
//                              background; pairs: [[frame of the video, row of the training frames], ...]
//   GET    api/motion          ?tab -> {"state", "done", "total", "message", "track", "path", "fps", "farthest"}
//
// Every request needs the token (server/request_guard.h): ?token= or the header X-Editor-Token. Mistakes are answered
// with {"error": message}: 400 malformed, 403 refused, 404 unknown, 409 not now, 410 deleted meanwhile,
// 413 more than 1 MiB.
// Each tab has an edit session of its own; all share one thread that renders.
#pragma once

#include <functional>
#include <memory>
#include <string>
#include <vector>

#include "libeditnerf/training/run.h"

namespace editnerf {

struct EditorServerOptions {
  std::string host = "127.0.0.1";        // address to listen on
  int port = 0;                          // 0: any that is free
  bool any_port_if_taken = false;        // rather than an error
  std::vector<std::string> allow_hosts;  // more names under which the editor is reached, such as a proxy's
  std::string token;                     // not empty
  std::string page;                      // HTML; {{nonce}} is replaced by the nonce of its script
  std::string title;                     // the run's name, shown in the page
};

class EditorServer {
 public:
  // Listens, but answers only in Serve. Throws ConfigError where the address or port cannot be had, DataError for a
  // pretrained run.
  EditorServer(Run run, const EditorServerOptions& options);
  ~EditorServer();

  int port() const;
  std::string Url() const;  // with the token

  // Answers until `stop`, asked ten times a second, says so.
  void Serve(const std::function<bool()>& stop);

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace editnerf
