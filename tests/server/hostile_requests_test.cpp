// Requests that no page of the editor makes, and temporary files that vanish: clear messages, and the server goes on.
#include <httplib.h>
#include <netinet/in.h>
#include <sys/socket.h>
#include <sys/stat.h>
#include <unistd.h>

#include <cerrno>
#include <chrono>
#include <cstdlib>
#include <filesystem>
#include <string>
#include <thread>
#include <utility>
#include <vector>

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

// A connection over which half of a request was sent.
class HalfSent {
 public:
  explicit HalfSent(int port) : socket_(::socket(AF_INET, SOCK_STREAM, 0)) {
    REQUIRE(socket_ >= 0);
    sockaddr_in address = {};
    address.sin_family = AF_INET;
    address.sin_port = htons(static_cast<uint16_t>(port));
    address.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
    REQUIRE(::connect(socket_, reinterpret_cast<const sockaddr*>(&address), sizeof address) == 0);
    constexpr char kHalf[] = "GET /api/scene HTTP/1.1\r\nHost: local";
    REQUIRE(::send(socket_, kHalf, sizeof kHalf - 1, 0) == static_cast<ssize_t>(sizeof kHalf - 1));
  }
  HalfSent(HalfSent&& other) noexcept : socket_(std::exchange(other.socket_, -1)) {}
  bool IsOpen() const {
    char byte = 0;
    return ::recv(socket_, &byte, 1, MSG_DONTWAIT | MSG_PEEK) < 0 && (errno == EAGAIN || errno == EWOULDBLOCK);
  }
  ~HalfSent() {
    if (socket_ >= 0) ::close(socket_);
  }

 private:
  int socket_;
};

Json VideoWhenItEnds(httplib::Client& client) {
  for (;; std::this_thread::sleep_for(std::chrono::milliseconds(20))) {
    Json status = Json::parse(client.Get("/api/video")->body);
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

TEST_CASE("values of a wrong type and missing ones are refused by name") {
  Desk desk;
  auto client = desk.Client();
  desk.Edit(Json::array());
  const auto refused = [&](const char* path, const std::string& body) {
    std::string error = ErrorOf(client.Post(path, body, "application/json"), 400);
    INFO(path << " " << body << ": " << error);
    CHECK(error.find("json.exception") == std::string::npos);
    return error;
  };
  CHECK_THAT(refused("/api/edit", "7"), HasText("request: expected a JSON object, found 7"));
  CHECK_THAT(refused("/api/edit", R"({"tab": 5})"), HasText("tab: expected a name in quotes, found 5"));
  CHECK_THAT(refused("/api/edit", R"({"operations": []})"),
             HasText("tab: expected a name of 1 to 64 characters, found none"));
  CHECK_THAT(refused("/api/edit", R"({"tab": "a", "operations": {}})"), HasText("operations: expected a list"));
  CHECK_THAT(refused("/api/edit", R"({"tab": "a", "operations": [7]})"), HasText("operations[0]"));
  CHECK_THAT(refused("/api/edit", R"({"tab": "a", "operations": [{"do": 7}]})"),
             HasText("operations[0]: do: expected one of"));
  CHECK_THAT(refused("/api/edit", R"({"tab": "a", "operations": [{"do": "place", "key_point": 0, "position": "x"}]})"),
             HasText("position"));
  CHECK_THAT(refused("/api/edit", R"({"tab": "a", "operations": [{"do": "snap", "row": 1.5}]})"), HasText("row"));
  CHECK_THAT(refused("/api/edit", R"({"tab": "a", "operations": [{"do": "reset", "key_point": 0, "gesture": "x"}]})"),
             HasText("gesture"));
  CHECK_THAT(refused("/api/edit", R"({"tab": "a", "operations": [{"do": "remove_key_frame", "index": 0}]})"),
             HasText("key frame 0: the trail has 0"));
  CHECK_THAT(refused("/api/edit", R"({"tab": "a", "picture": 7})"), HasText("picture"));
  CHECK_THAT(refused("/api/edit", R"({"tab": "a", "picture": {"width": 64, "preview": "yes"}})"),
             HasText("preview: expected true or false, found \"yes\""));
  CHECK_THAT(refused("/api/video", R"({"tab": "a", "fps": "x", "width": 64})"), HasText("fps"));
  CHECK_THAT(refused("/api/video", R"({"tab": ["a"], "fps": 24, "width": 64})"),
             HasText("tab: expected a name in quotes"));
  CHECK_THAT(refused("/api/motion", R"({"tab": "a", "u": 1, "v": 1})"), HasText("key_point"));
  CHECK_THAT(refused("/api/motion", R"({"tab": "a", "u": 1, "v": 1, "key_point": 0, "reversed": 3})"),
             HasText("reversed: expected true or false, found 3"));
  CHECK_THAT(refused("/api/motion", R"({"tab": "a", "u": 1, "v": 1, "key_point": 0, "axes": 7})"),
             HasText("axes: expected 1 or 2, found 7"));
  CHECK_THAT(refused("/api/motion", R"({"tab": "a", "u": 1, "v": 1, "key_point": 0, "pairs": [[1, "x"]]})"),
             HasText("pairs[0]"));
  CHECK_THAT(ErrorOf(client.Get("/api/trail?tab=a&fps=2x"), 400), HasText("fps: expected a number, found '2x'"));
}

// Others may open connections as well, without the token.
TEST_CASE("dozens of requests that are never finished keep nobody waiting") {
  Desk desk;
  std::vector<HalfSent> connections;
  for (int i = 0; i < 60; ++i) connections.emplace_back(desk.server().port());
  auto client = desk.Client();
  client.set_read_timeout(std::chrono::seconds(60));
  const auto answer = client.Get("/api/scene");
  REQUIRE(answer);
  CHECK(answer->status == 200);
  int open = 0;
  for (const HalfSent& connection : connections) open += connection.IsOpen() ? 1 : 0;
  CHECK(open > 30);  // it was not answered because these were given up
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
