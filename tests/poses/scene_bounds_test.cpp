#include "libeditnerf/poses/scene_bounds.h"

#include <cmath>

#include "libeditnerf/base/error.h"
#include "libeditnerf/imaging/importers/colmap_model.h"
#include "tests/catch.h"
#include "tests/imaging/colmap_fixture.h"
#include "tests/imaging/messages.h"

using namespace editnerf;

namespace {

ImportedModel ArcModel() {
  const ScratchFolder folder;
  WriteColmapBinary(ArcFixture(6), folder.path());
  return ReadColmapModel(folder.path(), "");
}

}  // namespace

TEST_CASE("points and cameras fit the unit cube, and near and far enclose what the cameras see") {
  const ImportedModel model = ArcModel();
  const SceneTransform transform = EstimateSceneTransform(model);
  for (const ImportedFrame& frame : model.frames) {
    const Vec3 position = (frame.camera.position - transform.center) * transform.scale;
    CHECK(Norm(position) <= 0.5 + 1e-9);
    for (int64_t p = 0; p < model.points.size(0); ++p) {
      const double* x = model.points.data_ptr<double>() + 3 * p;
      const Vec3 point = {x[0], x[1], x[2]};
      const double distance = Norm(point - frame.camera.position) * transform.scale;
      CHECK(distance > transform.near);
      CHECK(distance < transform.far);
      CHECK(Norm((point - transform.center) * transform.scale) < 0.6);
    }
  }
}

TEST_CASE("a few stray points do not change the scene's size much") {
  ImportedModel model = ArcModel();
  const SceneTransform clean = EstimateSceneTransform(model);
  model.points = torch::cat({model.points.repeat({10, 1}), torch::full({4, 3}, 1e6, torch::kFloat64)});
  const SceneTransform stray = EstimateSceneTransform(model);
  CHECK(std::abs(stray.scale / clean.scale - 1) < 0.1);
  CHECK(std::abs(stray.far / stray.scale - clean.far / clean.scale) < 1e-9);
}

TEST_CASE("sources without points use their bounds or what the cameras look at") {
  ImportedModel model = ArcModel();
  model.points = torch::Tensor();
  const SceneTransform looked_at = EstimateSceneTransform(model);
  CHECK(std::abs(looked_at.near / looked_at.scale - 0.25 * 4) < 1e-6);  // all are 4 away from (2, 0, 5)
  CHECK(std::abs(looked_at.far / looked_at.scale - 2 * 4) < 1e-6);
  for (ImportedFrame& frame : model.frames) {
    frame.near = 2;
    frame.far = 10;
  }
  const SceneTransform bounded = EstimateSceneTransform(model);
  CHECK(std::abs(bounded.near / bounded.scale - 1.8) < 1e-9);
  CHECK(std::abs(bounded.far / bounded.scale - 11) < 1e-9);

  ImportedModel parallel;
  parallel.frames.resize(3);
  CHECK_THAT(MessageOf<DataError>([&] { EstimateSceneTransform(parallel); }),
             HasText("neither points nor depth bounds, and its cameras do not look at one place"));
  CHECK_THROWS_AS(EstimateSceneTransform(ImportedModel()), DataError);
}
