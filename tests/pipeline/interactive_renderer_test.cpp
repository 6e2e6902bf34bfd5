#include "libeditnerf/pipeline/interactive_renderer.h"

#include "libeditnerf/base/error.h"
#include "tests/catch.h"
#include "tests/editing/editable_fixture.h"

using namespace editnerf;

namespace {

PictureRequest Middle() {
  const KeyPointTracks tracks(FixtureTracks());
  PictureRequest request;
  request.row = 2;
  request.key_points = tracks.Row(2);
  request.camera = FixtureScene().frames[2].camera;
  return request;
}

}  // namespace

TEST_CASE("an interactive picture has the size that is asked for, and shows where key points are") {
  InteractiveRenderer renderer(FixtureRun());
  PictureRequest request = Middle();
  const torch::Tensor picture = renderer.Render(request);
  CHECK(picture.sizes() == torch::IntArrayRef({18, 32, 3}));
  CHECK(picture.scalar_type() == torch::kUInt8);
  request.width = 64;
  CHECK(renderer.Render(request).sizes() == torch::IntArrayRef({36, 64, 3}));
  request.width = 0;
  request.key_points[0].y -= 0.1;
  CHECK_FALSE(torch::equal(renderer.Render(request), picture));
}

TEST_CASE("a state that comes back shows the same bytes, whatever the grids have room for by now") {
  InteractiveRenderer renderer(FixtureRun());
  const torch::Tensor first = renderer.Render(Middle());
  PictureRequest far = Middle();
  far.key_points[0].y -= 0.4;
  far.preview = true;
  renderer.Render(far);
  CHECK(torch::equal(renderer.Render(Middle()), first));
}

TEST_CASE("a picture that nobody waits for is given up between its strips, and made anew when it is asked for") {
  InteractiveRenderer renderer(FixtureRun());
  PictureRequest request = Middle();
  request.width = 320;
  int asked = 0;
  CHECK_FALSE(renderer.Render(request, [&] { return ++asked == 2; }).defined());
  CHECK(asked == 2);
  // In strips or in one piece, the picture is the same.
  const torch::Tensor strips = renderer.Render(request, [] { return false; });
  CHECK(torch::equal(strips, InteractiveRenderer(FixtureRun()).Render(request)));
}

TEST_CASE("other pictures can be made between the strips of one") {
  PictureRequest large = Middle(), other = Middle();
  large.width = 320;
  large.passing = true;
  other.key_points[0].y -= 0.05;
  InteractiveRenderer renderer(FixtureRun());
  torch::Tensor between;
  const auto make_another = [&] {
    if (!between.defined()) between = renderer.Render(other);
    return false;
  };
  const torch::Tensor picture = renderer.Render(large, make_another);
  CHECK(torch::equal(between, InteractiveRenderer(FixtureRun()).Render(other)));
  CHECK(torch::equal(picture, InteractiveRenderer(FixtureRun()).Render(large)));
}

TEST_CASE("a preview takes half the steps along rays, a passing picture all") {
  InteractiveRenderer renderer(FixtureRun());
  const torch::Tensor full = renderer.Render(Middle());
  PictureRequest request = Middle();
  request.passing = true;
  CHECK(torch::equal(InteractiveRenderer(FixtureRun()).Render(request), full));
  request.preview = true;
  const torch::Tensor preview = InteractiveRenderer(FixtureRun()).Render(request);
  CHECK_FALSE(torch::equal(preview, full));
  request.preview = false;
  CHECK(torch::equal(InteractiveRenderer(FixtureRun({"render.march_steps=64"})).Render(request), preview));
}

TEST_CASE("weights lie over the picture by the share that is asked for") {
  InteractiveRenderer renderer(FixtureRun());
  PictureRequest request = Middle();
  const auto rendered = [&](double share) {
    request.weights = share;
    return renderer.Render(request).to(torch::kFloat32);
  };
  const torch::Tensor none = rendered(0), all = rendered(1);
  REQUIRE((all - none).abs().max().item<double>() > 20);
  CHECK((rendered(0.5) - 0.5 * (none + all)).abs().max().item<double>() <= 1.5);  // rounded twice
  request.weights = 1.5;
  CHECK_THROWS_WITH(renderer.Render(request), HasText("expected a share from 0 to 1, found 1.5"));
}

TEST_CASE("a picture of the wrong number of key points is refused") {
  InteractiveRenderer renderer(FixtureRun());
  PictureRequest request = Middle();
  request.key_points.pop_back();
  CHECK_THROWS_AS(renderer.Render(request), DataError);
}
