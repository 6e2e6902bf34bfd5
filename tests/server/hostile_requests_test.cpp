// Requests that no page of the editor makes, and temporary files that vanish: clear messages, and the server goes on.
#include <httplib.h>
#include <sys/stat.h>

#include <chrono>
#include <cstdlib>
#include <filesystem>
#include <string>
#include <thread>

#include "libeditnerf/server/temporary_folder.h"
#include "tests/catch.h"
#include "tests/editing/moving_patch.h"
#include "tests/imaging/scratch_folder.h"
#include "tests/server/editor_desk.h"

using namespace editnerf;
namespace fs = std::filesystem;

namespace {

// Where temporary folders are made, while it lives.
class TemporaryFilesIn {
 public:
  explicit TemporaryFilesIn(const fs::path& folder) {
    if (const char* before = std::getenv("TMPDIR")) before_ = before;
    ::setenv("TMPDIR", folder.c_str(), 1);
  }
  ~TemporaryFilesIn() {
    if (before_.empty()) {
      ::unsetenv("TMPDIR");
    } else {
      ::setenv("TMPDIR", before_.c_str(), 1);
    }
  }

 private:
  std::string before_;
};

void DeleteEverythingIn(const fs::path& folder) {
  for (const auto& entry : fs::directory_iterator(folder)) fs::remove_all(entry);
}

httplib::Result SendPiece(httplib::Client& client, const std::string& where, const std::string& bytes) {
  return client.Post("/api/motion/video?tab=a&" + where, bytes, "application/octet-stream");
}

Json VideoWhenItEnds(httplib::Client& client) {
  for (;; std::this_thread::sleep_for(std::chrono::milliseconds(20))) {
    const Json status = Json::parse(client.Get("/api/video")->body);
    if (status["state"] != "running") return status;
  }
}

}  // namespace

TEST_CASE("a video over the limit is refused with its first piece, and one that lies about its size at the limit") {
  Desk desk;
  auto client = desk.Client();
  CHECK_THAT(ErrorOf(SendPiece(client, "offset=0&size=209715201&last=0", "x"), 400),
             HasText("video: it has 201 MiB, and at most 200 can be sent"));
  CHECK_THAT(ErrorOf(SendPiece(client, "offset=209715200&size=9&last=0", "x"), 400), HasText("at most 200"));
  CHECK_THAT(ErrorOf(SendPiece(client, "offset=0&last=0", "x"), 400), HasText("size: expected a whole number"));
  CHECK_THAT(ErrorOf(SendPiece(client, "offset=-1&size=9&last=0", "x"), 400), HasText("found '-1'"));
  CHECK(SendPiece(client, "offset=0&size=209715200&last=0", "x")->status == 200);
}

TEST_CASE("bodies that are not what they say are refused") {
  Desk desk;
  auto client = desk.Client();
  const auto post = [&](const std::string& body, const char* type) { return client.Post("/api/edit", body, type); };
  const std::string deep(1 << 19, '[');
  CHECK_THAT(ErrorOf(post(deep, "application/json"), 400), HasText("request: nested deeper than"));
  CHECK_THAT(ErrorOf(post(deep + std::string(1 << 19, ']'), "application/json"), 400),
             HasText("request: nested deeper than"));
  CHECK_THAT(ErrorOf(post(std::string("{\"tab\": \"\0\xff\"}", 13), "application/json"), 400), HasText("request"));
  CHECK_THAT(ErrorOf(post(R"({"tab": "a", "operations": 7})", "application/json"), 400), HasText("a list of at most"));
  // Multipart without a boundary, with one that never comes, and cut off in a header.
  for (const char* type : {"multipart/form-data", "multipart/form-data; boundary=b"}) {
    for (const char* body : {"x", "--b\r\nContent-Disposition: form-data; na", "--b\r\n\r\n--b--"}) {
      const auto answer = post(body, type);
      REQUIRE(answer);
      INFO(type << ", " << body << ": " << answer->body);
      CHECK(answer->status == 400);
      CHECK(!Json::parse(answer->body).at("error").get<std::string>().empty());
    }
  }
  CHECK(desk.Edit(Json::array())["picture"]["width"] == 32);
}

TEST_CASE("temporary folders that are deleted are made anew") {
  const ScratchFolder scratch;
  const TemporaryFilesIn here(scratch.path());
  Desk desk;
  auto client = desk.Client();
  WriteMovingPatch(scratch / "clip.mp4", 4);
  const std::string bytes = ReadText(scratch / "clip.mp4"), size = "&size=" + std::to_string(bytes.size());
  REQUIRE(SendPiece(client, "offset=0&last=0" + size, bytes.substr(0, 1000))->status == 200);

  DeleteEverythingIn(scratch.path());
  CHECK_THAT(ErrorOf(SendPiece(client, "offset=1000&last=1" + size, bytes.substr(1000)), 400),
             HasText("video: it cannot be kept; choose it again"));
  CHECK(SendPiece(client, "offset=0&last=1" + size, bytes)->status == 200);

  desk.Edit({{{"do", "key_frame"}, {"time", 0}}, {{"do", "key_frame"}, {"time", 0.2}}});
  DeleteEverythingIn(scratch.path());
  const std::string wish = R"({"tab": "a", "fps": 10, "width": 64})";
  REQUIRE(client.Post("/api/video", wish, "application/json")->status == 200);
  CHECK(VideoWhenItEnds(client)["state"] == "done");
  CHECK(client.Get("/api/video/file")->status == 200);
  DeleteEverythingIn(scratch.path());
  CHECK_THAT(ErrorOf(client.Get("/api/video/file"), 410), HasText("the video was deleted"));
}

TEST_CASE("a temporary folder is for its owner alone, also when it is made anew") {
  const ScratchFolder scratch;
  const TemporaryFilesIn here(scratch.path());
  fs::path made;
  {
    const TemporaryFolder folder;
    made = (folder / "file").parent_path();
    fs::remove_all(made);
    folder.Restore();
    struct stat about = {};
    REQUIRE(::stat(made.c_str(), &about) == 0);
    CHECK((about.st_mode & 0777) == 0700);
    folder.Restore();  // and is left alone where it is there
    fs::remove_all(scratch.path());
    CHECK_THROWS_WITH(folder.Restore(), HasText("was deleted and cannot be made anew"));
  }
  CHECK(!fs::exists(made));
}
