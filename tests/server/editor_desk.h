// A server that runs while the test does, with an untrained run, and requests to it.
#pragma once

#include <httplib.h>

#include <atomic>
#include <string>
#include <thread>

#include "libeditnerf/imaging/json_file.h"
#include "libeditnerf/server/editor_server.h"
#include "tests/catch.h"
#include "tests/editing/editable_fixture.h"

namespace editnerf {

class Desk {
 public:
  Desk() : server_(FixtureRun(), Options()), thread_([this] { server_.Serve([this] { return stop_.load(); }); }) {}
  ~Desk() {
    stop_ = true;
    thread_.join();
  }

  httplib::Client Client(const std::string& token = "secret") const {
    httplib::Client client("127.0.0.1", server_.port());
    client.set_default_headers({{"X-Editor-Token", token}});
    client.set_read_timeout(60);
    return client;
  }

  // The answer to POST api/edit, which must succeed.
  Json Edit(const Json& operations, const std::string& tab = "a") const {
    const Json body = {{"tab", tab}, {"operations", operations}, {"picture", {{"width", 32}}}};
    const auto answer = Client().Post("/api/edit", body.dump(), "application/json");
    REQUIRE(answer);
    INFO(answer->body);
    REQUIRE(answer->status == 200);
    return Json::parse(answer->body);
  }

  EditorServer& server() { return server_; }

 private:
  static EditorServerOptions Options() {
    EditorServerOptions options;
    options.token = "secret";
    options.page = "<script nonce=\"{{nonce}}\"></script>";
    options.title = "fixture";
    return options;
  }

  EditorServer server_;
  std::atomic<bool> stop_{false};
  std::thread thread_;
};

// The message of an answer that has to be a refusal with this status.
inline std::string ErrorOf(const httplib::Result& answer, int status) {
  REQUIRE(answer);
  INFO(answer->body);
  CHECK(answer->status == status);
  return Json::parse(answer->body).at("error");
}

}  // namespace editnerf
