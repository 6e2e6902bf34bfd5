#include "libeditnerf/pipeline/stages.h"

#include "libeditnerf/base/error.h"
#include "libeditnerf/pipeline/whole_way.h"
#include "tests/catch.h"
#include "tests/imaging/scratch_folder.h"

using namespace editnerf;

TEST_CASE("rays through what stands still need marching, and the whole way says so before it begins") {
  Config config;
  config.render.sampler = "hierarchical";
  CHECK_NOTHROW(CheckTraining(config));
  config.train.still_share = 0.1;
  CHECK_THROWS_WITH(CheckTraining(config), HasText("train.still_share"));
  std::swap(config.train.still_share, config.train.carried_share);
  CHECK_THROWS_WITH(CheckTraining(config), HasText("train.carried_share"));
  const ScratchFolder scratch;
  WholeWayRequest request;
  request.input = scratch.path();
  request.work = scratch.path() / "work";
  request.config = config;
  CHECK_THROWS_AS(RunWholeWay(request), ConfigError);
  CHECK(!std::filesystem::exists(request.work));
  config.render.sampler = "occupancy";
  CHECK_NOTHROW(CheckTraining(config));
}
