#include "libeditnerf/scene/timeline.h"

#include "libeditnerf/base/error.h"
#include "tests/catch.h"

using namespace editnerf;

namespace {

Scene MakeScene(std::vector<int64_t> warp_ids, std::vector<int64_t> train) {
  Scene scene;
  scene.name = "test";
  for (const int64_t id : warp_ids) {
    SceneFrame frame;
    frame.id = std::to_string(scene.frames.size());
    frame.warp_id = id;
    scene.frames.push_back(frame);
  }
  scene.train = std::move(train);
  return scene;
}

}  // namespace

TEST_CASE("a frame with a training frame's state is found exactly") {
  const TimelinePosition position = LocateInTime(MakeScene({0, 5, 9, 5}, {0, 1, 2}), 3);
  CHECK(position.trained);
  CHECK(position.before == 1);
  CHECK(position.weight == 0);
}

TEST_CASE("a held-out frame lies between its neighbours in time") {
  const TimelinePosition position = LocateInTime(MakeScene({0, 1, 4}, {0, 2}), 1);
  CHECK_FALSE(position.trained);
  CHECK(position.before == 0);
  CHECK(position.after == 1);
  CHECK(position.weight == Approx(0.25));
}

TEST_CASE("a frame beyond the last training frame takes its state") {
  const TimelinePosition position = LocateInTime(MakeScene({0, 1, 2}, {0, 1}), 2);
  CHECK(position.before == 1);
  CHECK(position.after == 1);
}

TEST_CASE("an edit frame has no place in time") {
  CHECK_THROWS_WITH(LocateInTime(MakeScene({0, 1, -1}, {0, 1}), 2), "test: frame 2 has no place in time");
}
