// The server over real connections, with an untrained run.
#include "libeditnerf/server/editor_server.h"

#include <httplib.h>

#include <chrono>
#include <thread>

#include "libeditnerf/base/error.h"
#include "libeditnerf/editing/edit_file.h"
#include "libeditnerf/imaging/json_file.h"
#include "tests/catch.h"
#include "tests/editing/editable_fixture.h"
#include "tests/editing/moving_patch.h"
#include "tests/imaging/scratch_folder.h"
#include "tests/server/editor_desk.h"

using namespace editnerf;

namespace {

Json Move(double u, double v) { return {{"do", "move"}, {"key_point", 0}, {"u", u}, {"v", v}}; }

}  // namespace

TEST_CASE("the editor answers only with its token, to its own page and under its own name") {
  Desk desk;
  for (const char* path : {"/", "/api/scene", "/api/video", "/nothing"}) {
    CHECK_THAT(ErrorOf(desk.Client("wrong").Get(path), 403), HasText("the token is wrong"));
  }
  auto client = desk.Client();
  CHECK_THAT(ErrorOf(client.Get("/api/scene", {{"Origin", "http://evil.example"}}), 403),
             HasText("the page at 'http://evil.example' is not this editor's"));
  CHECK_THAT(ErrorOf(client.Get("/api/scene", {{"Host", "evil.example"}}), 403), HasText("--allow-host"));
  CHECK_THAT(ErrorOf(client.Get("/nothing"), 404), HasText("nothing at this address"));
  const auto page = httplib::Client("127.0.0.1", desk.server().port()).Get("/?token=secret");
  REQUIRE(page);
  CHECK(page->status == 200);
  CHECK_THAT(page->get_header_value("Content-Security-Policy"), HasText("default-src 'none'; script-src 'nonce-"));
  CHECK(page->body.find("{{nonce}}") == std::string::npos);
  CHECK_THAT(desk.server().Url(), HasText("/?token=secret"));
}

TEST_CASE("malformed and oversized requests are refused with what was expected") {
  Desk desk;
  auto client = desk.Client();
  const auto post = [&](const std::string& body) { return client.Post("/api/edit", body, "application/json"); };
  CHECK_THAT(ErrorOf(post("{\"tab\": "), 400), HasText("request: expected JSON: parse error"));
  CHECK_THAT(ErrorOf(post("[]"), 400), HasText("expected a JSON object"));
  CHECK_THAT(ErrorOf(post("{}"), 400), HasText("tab: expected a name"));
  CHECK_THAT(ErrorOf(post("{\"tab\": 5}"), 400), HasText("request"));
  CHECK_THAT(ErrorOf(post(R"({"tab": "a", "operations": [{"do": "fly"}]})"), 400),
             HasText("request: operations[0]: do: expected one of camera, clear_trail"));
  CHECK_THAT(ErrorOf(post(R"({"tab": "a", "operations": [{"do": "move", "key_point": 0}]})"), 400), HasText("'u'"));
  CHECK_THAT(ErrorOf(post(R"({"tab": "a", "picture": {"width": 100000}})"), 400), HasText("width: expected 16 to"));
  CHECK_THAT(ErrorOf(post(std::string(2 << 20, ' ')), 413), HasText("larger than 1 MiB"));
  CHECK_THAT(ErrorOf(client.Get("/api/trail?tab=a"), 400), HasText("there is no key frame"));
  CHECK_THAT(ErrorOf(client.Get("/api/video/file"), 409), HasText("no video is ready"));
}

TEST_CASE("a drag changes the picture, undo restores it bit for bit, and another tab sees none of it") {
  Desk desk;
  const Json first = desk.Edit(Json::array());
  CHECK(first["picture"]["width"] == 32);
  CHECK(first["picture"]["height"] == 18);
  const Json moved = desk.Edit(Json::array({Move(28, 2)}));
  CHECK(moved["picture"]["data"] != first["picture"]["data"]);
  CHECK(moved["state"]["key_points"][0]["u"].get<double>() == Approx(28));
  CHECK(moved["state"]["can_undo"] == true);
  CHECK(desk.Edit(Json::array(), "b")["picture"]["data"] == first["picture"]["data"]);
  const Json undone = desk.Edit(Json::array({{{"do", "undo"}}}));
  CHECK(undone["picture"]["data"] == first["picture"]["data"]);
  CHECK(desk.Edit(Json::array({{{"do", "redo"}}}))["picture"]["data"] == moved["picture"]["data"]);
}

TEST_CASE("a trail is handed out as an edit file and becomes a video, once at a time") {
  Desk desk;
  desk.Edit({{{"do", "key_frame"}, {"time", 0}}, Move(20, 5), {{"do", "key_frame"}, {"time", 0.5}}});
  auto client = desk.Client();
  const auto trail = client.Get("/api/trail?tab=a&fps=10");
  REQUIRE(trail);
  CHECK(ParseEditFile(trail->body, "edit.json").frames.size() == 6);
  const std::string wish = R"({"tab": "a", "fps": 10, "width": 64})";
  const auto state = [&] { return Json::parse(client.Get("/api/video")->body); };
  REQUIRE(client.Post("/api/video", wish, "application/json")->status == 200);
  while (state()["state"] == "running") std::this_thread::sleep_for(std::chrono::milliseconds(20));
  INFO(state().dump());
  REQUIRE(state()["state"] == "done");
  CHECK(state()["done"] == 6);
  CHECK(client.Get("/api/video/file")->body.substr(4, 4) == "ftyp");
  REQUIRE(client.Post("/api/video", R"({"tab": "a", "fps": 120, "width": 640})", "application/json")->status == 200);
  CHECK(client.Post("/api/video", wish, "application/json")->status == 409);
  client.Delete("/api/video");
  while (state()["state"] == "running") std::this_thread::sleep_for(std::chrono::milliseconds(20));
  CHECK(state()["state"] == "cancelled");
}

TEST_CASE("a video is its tab's own: others neither see nor cancel it, and wait for their turn") {
  Desk desk;
  for (const char* tab : {"a", "b"}) {
    desk.Edit({{{"do", "key_frame"}, {"time", 0}}, {{"do", "key_frame"}, {"time", 1}}}, tab);
  }
  auto client = desk.Client();
  const auto start = [&](const char* wish) { return client.Post("/api/video", wish, "application/json"); };
  const auto state = [&](const std::string& tab) {
    return Json::parse(client.Get("/api/video?tab=" + tab)->body)["state"].get<std::string>();
  };
  REQUIRE(start(R"({"tab": "a", "fps": 120, "width": 640})")->status == 200);
  CHECK(state("a") == "running");
  CHECK(state("b") == "none");
  CHECK_THAT(ErrorOf(start(R"({"tab": "b", "fps": 10, "width": 64})"), 409),
             HasText("another tab is rendering a video; wait for it, or cancel it there"));
  CHECK_THAT(ErrorOf(start(R"({"tab": "a", "fps": 10, "width": 64})"), 409), HasText("cancel it, or wait for it"));
  CHECK(Json::parse(client.Delete("/api/video?tab=b")->body)["state"] == "none");
  CHECK(state("a") == "running");
  client.Delete("/api/video?tab=a");
  const auto wait_for = [&](const std::string& tab) {
    while (state(tab) == "running") std::this_thread::sleep_for(std::chrono::milliseconds(20));
    return state(tab);
  };
  CHECK(wait_for("a") == "cancelled");
  REQUIRE(start(R"({"tab": "b", "fps": 10, "width": 64})")->status == 200);
  CHECK(wait_for("b") == "done");
  CHECK(client.Get("/api/video/file?tab=b")->body.substr(4, 4) == "ftyp");
  CHECK_THAT(ErrorOf(client.Get("/api/video/file?tab=a"), 409), HasText("no video is ready"));
}

TEST_CASE("a video is brought in pieces, and its motion drives a key point") {
  Desk desk;
  const ScratchFolder folder;
  WriteMovingPatch(folder / "clip.mp4", 6);
  const std::string bytes = ReadText(folder / "clip.mp4");
  auto client = desk.Client();
  const auto piece = [&](const std::string& where, const std::string& body) {
    return client.Post("/api/motion/video?tab=a&" + where, body, "application/octet-stream");
  };
  const std::string size = "&size=" + std::to_string(bytes.size());
  const std::string follow = R"({"tab": "a", "u": 40, "v": 40, "key_point": 0, "axes": 1})";
  CHECK_THAT(ErrorOf(client.Post("/api/motion", follow, "application/json"), 400), HasText("there is none yet"));
  CHECK_THAT(ErrorOf(piece("offset=x&size=9&last=0", ""), 400), HasText("offset: expected a whole number, found 'x'"));
  CHECK_THAT(ErrorOf(piece("offset=7&size=9&last=0", "late"), 400),
             HasText("expected the piece at byte 0, found the one at 7"));
  CHECK_THAT(ErrorOf(piece("offset=0&size=8&last=1", "no video"), 400), HasText("cannot be read as a video"));
  CHECK_THAT(ErrorOf(piece("offset=0&size=9&last=0", std::string(2 << 20, 'x')), 413), HasText("larger than 1 MiB"));
  REQUIRE(piece("offset=0&last=0" + size, bytes.substr(0, 1000))->status == 200);
  const Json frame = Json::parse(piece("offset=1000&last=1" + size, bytes.substr(1000))->body);
  CHECK(frame["width"] == 128);
  CHECK(frame["height"] == 96);
  const auto motion = [&](const std::string& wish) {
    REQUIRE(client.Post("/api/motion", wish, "application/json")->status == 200);
    for (;; std::this_thread::sleep_for(std::chrono::milliseconds(20))) {
      const Json status = Json::parse(client.Get("/api/motion?tab=a")->body);
      if (status["state"] != "running") return status;
    }
  };
  const Json found = motion(follow);
  INFO(found.dump());
  REQUIRE(found["state"] == "done");
  CHECK(found["path"].size() == 6);
  CHECK(found["path"][5][0].get<double>() == Approx(0.1).margin(0.01));
  // Its first frame is training frame 3, its last training frame 1.
  const Json paired = motion(R"({"tab": "a", "u": 40, "v": 40, "key_point": 0, "pairs": [[0, 3], [5, 1]]})");
  INFO(paired.dump());
  REQUIRE(paired["state"] == "done");
  CHECK(paired["path"][0][0].get<double>() == Approx(0.05).margin(1e-6));
  CHECK(paired["path"][5][0].get<double>() == Approx(-0.05).margin(1e-6));
  CHECK_THAT(motion(R"({"tab": "a", "u": 40, "v": 40, "key_point": 0, "pairs": [[0, 3], [5, 9]]})")["message"].dump(),
             HasText("training frame 9: the run has 5"));
  CHECK_THAT(ErrorOf(client.Post("/api/motion", R"({"tab": "a", "u": 4, "v": 4, "key_point": 0, "pairs": [[0]]})",
                                 "application/json"),
                     400),
             HasText("pairs[0]: expected a frame of the video and a row"));
  CHECK(motion(R"({"tab": "a", "u": 500, "v": 40, "key_point": 0})")["message"] ==
        "video: the point 500,40 is not in the picture, which has 128 x 96 pixels");
  CHECK_THAT(
      ErrorOf(client.Post("/api/motion", R"({"tab": "a", "u": 4, "v": 4, "key_point": 9})", "application/json"), 400),
      HasText("key point 9: the run has 2"));
  CHECK(Json::parse(client.Get("/api/motion?tab=b")->body)["state"] == "none");
}

TEST_CASE("a tab hears that the server did not know it, once") {
  Desk desk;
  CHECK(desk.Edit(Json::array())["fresh"] == true);
  CHECK(desk.Edit(Json::array())["fresh"] == false);
  for (int i = 0; i < 40; ++i) desk.Edit(Json::array(), "other" + std::to_string(i));  // more than are kept
  CHECK(desk.Edit(Json::array())["fresh"] == true);
}

TEST_CASE("a port that is taken is a mistake of the command line") {
  Desk desk;
  EditorServerOptions options;
  options.token = "secret";
  options.port = desk.server().port();
  CHECK_THROWS_AS(EditorServer(FixtureRun(), options), ConfigError);
}
