#include "libeditnerf/server/request_guard.h"

#include "libeditnerf/server/base64.h"
#include "tests/catch.h"

using namespace editnerf;

TEST_CASE("a request needs the token") {
  const GuardOptions guard = {"secret", true, {}};
  CHECK(WhyRefused({"secret", "localhost:8088", ""}, guard).empty());
  CHECK(WhyRefused({"secret", "127.0.0.1:1", "http://127.0.0.1:1"}, guard).empty());
  CHECK(WhyRefused({"secret", "[::1]:8088", ""}, guard).empty());
  CHECK_THAT(WhyRefused({"", "localhost", ""}, guard), HasText("the token is missing"));
  CHECK_THAT(WhyRefused({"secreT", "localhost", ""}, guard), HasText("the token is wrong"));
  CHECK_THAT(WhyRefused({"secret2", "localhost", ""}, guard), HasText("the token is wrong"));
  CHECK(RandomToken().size() == 32);
  CHECK(RandomToken() != RandomToken());
}

TEST_CASE("other pages and other names are refused, with the token as well") {
  const GuardOptions guard = {"secret", true, {"studio.example"}};
  for (const char* origin :
       {"http://evil.example", "null", "http://localhost:3000", "http://localhost:8088.evil.example"}) {
    CHECK_THAT(WhyRefused({"secret", "localhost:8088", origin}, guard), HasText("is not this editor's"));
  }
  for (const char* host : {"evil.example", "10.0.0.1:8088", "localhost.evil.example", ""}) {
    CHECK_THAT(WhyRefused({"secret", host, ""}, guard), HasText("--allow-host"));
  }
  CHECK(WhyRefused({"secret", "studio.example", "https://studio.example"}, guard).empty());
  CHECK(WhyRefused({"secret", "127.0.0.1:8088", "https://studio.example"}, guard).empty());
  // Open to other machines: by a number, which no one can let point elsewhere.
  CHECK(WhyRefused({"secret", "10.0.0.1:8088", ""}, {"secret", false, {}}).empty());
  CHECK_FALSE(WhyRefused({"secret", "evil.example", ""}, {"secret", false, {}}).empty());
}

TEST_CASE("base64 follows RFC 4648") {
  CHECK(Base64("").empty());
  CHECK(Base64("f") == "Zg==");
  CHECK(Base64("fo") == "Zm8=");
  CHECK(Base64("foobar") == "Zm9vYmFy");
  CHECK(Base64(std::string("\xff\x00\xfe", 3)) == "/wD+");
}
