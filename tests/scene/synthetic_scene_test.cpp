#include "libeditnerf/scene/synthetic/synthetic_scene.h"

#include <torch/types.h>

#include <cmath>
#include <map>
#include <set>

#include "libeditnerf/base/error.h"
#include "libeditnerf/base/logging.h"
#include "tests/catch.h"

using namespace editnerf;

namespace {

SyntheticOptions Small() {
  SyntheticOptions options;
  options.frames = 16;
  options.val_frames = 3;
  options.edit_frames = 4;
  options.width = 64;
  options.height = 36;
  options.samples_per_side = 2;
  return options;
}

Scene Make(const std::string& name, const SyntheticOptions& options) {
  const LogLevel level = GetLogLevel();
  SetLogLevel(LogLevel::kWarning);
  Scene scene = MakeSyntheticScene(name, options);
  SetLogLevel(level);
  return scene;
}

const Scene& Fixture(const std::string& name) {
  static std::map<std::string, Scene> scenes;
  if (scenes.count(name) == 0) scenes[name] = Make(name, Small());
  return scenes[name];
}

double DepthAt(const Scene& scene, int64_t frame, int64_t x, int64_t y) {
  return scene.truth->depth.data_ptr<float>()[(frame * scene.height() + y) * scene.width() + x];
}

int MaskAt(const Scene& scene, int64_t frame, int64_t x, int64_t y) {
  return scene.truth->mask.data_ptr<uint8_t>()[(frame * scene.height() + y) * scene.width() + x];
}

Vec3 PointAt(const Scene& scene, int64_t frame, int64_t x, int64_t y) {
  const Camera& camera = scene.frames[static_cast<size_t>(frame)].camera;
  const double u = static_cast<double>(x) + 0.5, v = static_cast<double>(y) + 0.5;
  return camera.position + camera.DirectionThrough(u, v) * DepthAt(scene, frame, x, y);
}

torch::Tensor PoseOf(const Scene& scene, int64_t frame, int64_t object) {
  return scene.truth->scene_from_object[frame][object];
}

Vec3 Apply(const torch::Tensor& matrix, const Vec3& p) {
  const auto m = matrix.contiguous();
  const double* a = m.data_ptr<double>();
  return {a[0] * p.x + a[1] * p.y + a[2] * p.z + a[3], a[4] * p.x + a[5] * p.y + a[6] * p.z + a[7],
          a[8] * p.x + a[9] * p.y + a[10] * p.z + a[11]};
}

// How points of frame `from` with label `label`, carried by `carry`, are met by the depth map of frame `to`.
struct Meeting {
  int64_t same = 0;        // on the surface that `to` sees, and labelled alike
  int64_t hidden = 0;      // behind it, or at an edge of the picture or of a surface
  int64_t impossible = 0;  // in front of what `to` sees
};

Meeting Carry(const Scene& scene, int64_t from, int64_t to, int label, const torch::Tensor& carry) {
  const double tolerance = 0.004;  // scene units; surfaces slope within a pixel
  Meeting meeting;
  const Camera& camera = scene.frames[static_cast<size_t>(to)].camera;
  for (int64_t y = 0; y < scene.height(); ++y) {
    for (int64_t x = 0; x < scene.width(); ++x) {
      if (MaskAt(scene, from, x, y) != label) continue;
      const Vec3 point = Apply(carry, PointAt(scene, from, x, y));
      const Projected projected = Project(camera, point);
      const auto left = static_cast<int64_t>(std::floor(projected.u - 0.5));
      const auto top = static_cast<int64_t>(std::floor(projected.v - 0.5));
      if (!projected.valid || left < 0 || top < 0 || left + 1 >= scene.width() || top + 1 >= scene.height()) {
        ++meeting.hidden;
        continue;
      }
      double low = 1e9, high = 0, sum = 0;
      bool alike = true;
      for (int64_t corner = 0; corner < 4; ++corner) {
        const int64_t cx = left + corner % 2, cy = top + corner / 2;
        const double wx = 1 - std::abs(projected.u - 0.5 - static_cast<double>(cx));
        const double wy = 1 - std::abs(projected.v - 0.5 - static_cast<double>(cy));
        const double depth = DepthAt(scene, to, cx, cy);
        low = std::min(low, depth), high = std::max(high, depth);
        sum += wx * wy * depth;
        alike &= MaskAt(scene, to, cx, cy) == label;
      }
      const double distance = Norm(point - camera.position);
      if (high - low > 0.03 || distance > sum + tolerance) {
        ++meeting.hidden;
      } else if (distance < sum - tolerance) {
        ++meeting.impossible;
      } else {
        alike ? ++meeting.same : ++meeting.hidden;
      }
    }
  }
  return meeting;
}

}  // namespace

TEST_CASE("synthetic scenes are known by their names") {
  CHECK(SyntheticSceneNames() == std::vector<std::string>{"hinge", "keys", "cups", "cabinet", "static", "medley"});
  CHECK_THROWS_WITH(MakeSyntheticScene("cubs", {}),
                    "no synthetic scene is named 'cubs'; known are hinge, keys, cups, cabinet, static, medley");
  CHECK_THROWS_AS(MakeSyntheticScene("cubs", {}), ConfigError);
  SyntheticOptions options;
  options.frames = 1;
  CHECK_THROWS_WITH(MakeSyntheticScene("cups", options), "synthetic scene: frames: expected 2 to 100000, found 1");
}

TEST_CASE("synthetic splits keep training, known states and unseen states apart") {
  for (const std::string& name : SyntheticSceneNames()) {
    INFO(name);
    const Scene& scene = Fixture(name);
    const size_t edits = name == "static" ? 0 : 4;
    REQUIRE(scene.frames.size() == 16 + 3 + edits);
    REQUIRE(scene.train.size() == 16);
    REQUIRE(scene.val.size() == 3);
    REQUIRE(scene.edit.size() == edits);
    for (size_t k = 0; k < scene.train.size(); ++k) {
      const SceneFrame& frame = scene.frames[static_cast<size_t>(scene.train[k])];
      CHECK(frame.warp_id == static_cast<int64_t>(k));
      CHECK(frame.appearance_id == static_cast<int64_t>(k));
    }
    CHECK(scene.frames[0].id == "000000");
    for (const int64_t index : scene.val) {
      const SceneFrame& frame = scene.frames[static_cast<size_t>(index)];
      REQUIRE(frame.warp_id >= 0);
      REQUIRE(frame.warp_id < 16);
      CHECK(frame.appearance_id == frame.warp_id);
      CHECK(torch::equal(scene.truth->scene_from_object[index], scene.truth->scene_from_object[frame.warp_id]));
      for (const int64_t other : scene.train) {
        CHECK(Norm(frame.camera.position - scene.frames[static_cast<size_t>(other)].camera.position) > 0.01);
      }
    }
    for (const int64_t index : scene.edit) CHECK(scene.frames[static_cast<size_t>(index)].warp_id == -1);
  }
}

TEST_CASE("synthetic edit frames show states that training never showed, within its range") {
  for (const char* name : {"hinge", "keys", "cups", "cabinet"}) {
    INFO(name);
    const Scene& scene = Fixture(name);
    const auto poses = scene.truth->scene_from_object;
    const auto train = poses.slice(0, 0, 16);
    // Where each object's own origin lies, which object coordinates have at the world's.
    const Vec3 origin = -1 * scene.transform.scale * scene.transform.center;
    const auto places = torch::matmul(poses, torch::tensor({origin.x, origin.y, origin.z, 1.0}, torch::kFloat64));
    const auto known = places.slice(0, 0, 16);
    for (const int64_t index : scene.edit) {
      CHECK((train - poses[index]).abs().flatten(1).amax(1).min().item<double>() > 0.005);
      const auto translation = places[index];
      CHECK((translation <= known.amax(0) + 1e-9).all().item<bool>());
      CHECK((translation >= known.amin(0) - 1e-9).all().item<bool>());
    }
  }
}

TEST_CASE("a slide takes one part along a straight line that it never went, before one camera") {
  SyntheticOptions options;
  options.frames = 16;
  options.val_frames = options.edit_frames = 0;
  options.slide_frames = 3;
  options.width = 16;
  options.height = 9;
  options.samples_per_side = 1;
  const Scene scene = MakeSyntheticScene("cups", options);
  REQUIRE(scene.edit.size() == 3);
  const auto poses = scene.truth->scene_from_object;
  const auto train = poses.slice(0, 0, 16), slide = poses.slice(0, 16);
  // Equal steps of the first cup, and the other one rests.
  const auto steps = slide.slice(0, 1).sub(slide.slice(0, 0, 2)).select(1, 0);
  CHECK(steps.abs().max().item<double>() > 0.01);
  CHECK(torch::allclose(steps[0], steps[1], 0, 1e-9));
  CHECK(slide.select(1, 1).sub(slide[0][1]).abs().max().item<double>() == 0);
  CHECK((train.select(1, 0) - slide[1][0]).abs().flatten(1).amax(1).min().item<double>() > 0.01);
  for (const int64_t index : scene.edit) {
    const Camera& camera = scene.frames[static_cast<size_t>(index)].camera;
    CHECK(camera.position.x == scene.frames[16].camera.position.x);
    CHECK(camera.position.z == scene.frames[16].camera.position.z);
  }
}

TEST_CASE("synthetic depth lies along the rays of the pixel centres, between near and far") {
  for (const std::string& name : SyntheticSceneNames()) {
    INFO(name);
    const Scene& scene = Fixture(name);
    CHECK(scene.truth->depth.isfinite().all().item<bool>());
    CHECK(scene.truth->depth.min().item<double>() > scene.transform.near);
    CHECK(scene.truth->depth.max().item<double>() < scene.transform.far);
    CHECK(scene.truth->depth.min().item<double>() < scene.transform.near * 1.1);
    CHECK(scene.transform.scale != 1);
    for (const int64_t y : {3, 20}) {
      const Projected projected = Project(scene.frames[5].camera, PointAt(scene, 5, 40, y));
      CHECK(projected.u == Approx(40.5));
      CHECK(projected.v == Approx(static_cast<double>(y) + 0.5));
    }
  }
}

TEST_CASE("static points of synthetic scenes are found again in other frames") {
  for (const std::string& name : SyntheticSceneNames()) {
    INFO(name);
    const Scene& scene = Fixture(name);
    const Meeting meeting = Carry(scene, 2, 3, 0, torch::eye(4, torch::kFloat64));
    CHECK(meeting.same > 600);
    CHECK(meeting.impossible < 30);
    REQUIRE(scene.points.dim() == 2);
    CHECK(scene.points.size(0) > 300);
    CHECK(scene.points.norm(2, 1).max().item<double>() < 1);
  }
}

TEST_CASE("the moving parts of synthetic scenes are where their transforms carry them") {
  const struct {
    const char* name;
    int64_t object;
  } parts[] = {{"hinge", 0}, {"keys", 0}, {"cups", 0}, {"cups", 1}, {"cabinet", 0}, {"cabinet", 1}, {"cabinet", 2}};
  for (const auto& part : parts) {
    INFO(part.name << " " << part.object);
    const Scene& scene = Fixture(part.name);
    int64_t same = 0, impossible = 0, moved = 0;
    for (int64_t frame = 0; frame + 1 < 16; ++frame) {
      const auto from = PoseOf(scene, frame, part.object), to = PoseOf(scene, frame + 1, part.object);
      const Meeting meeting =
          Carry(scene, frame, frame + 1, static_cast<int>(part.object) + 1, to.matmul(from.inverse()));
      same += meeting.same;
      impossible += meeting.impossible;
      moved += (to - from).abs().max().item<double>() > 1e-3 ? 1 : 0;
    }
    CHECK(moved >= 4);
    CHECK(same > 100);
    CHECK(impossible <= same / 10);
  }
}

TEST_CASE("every moving part of a synthetic scene is visible in nearly all frames") {
  for (const char* name : {"hinge", "keys", "cups", "cabinet"}) {
    const Scene& scene = Fixture(name);
    const auto count = static_cast<int64_t>(scene.frames.size());
    for (size_t k = 0; k < scene.truth->objects.size(); ++k) {
      INFO(scene.truth->objects[k]);
      const auto pixels = (scene.truth->mask == static_cast<int64_t>(k + 1)).flatten(1).sum(1);
      CHECK((pixels >= 8).sum().item<int64_t>() >= count * 9 / 10);
    }
  }
}

TEST_CASE("the static scene has no moving parts") {
  const Scene& scene = Fixture("static");
  CHECK(scene.truth->objects.empty());
  CHECK(scene.truth->mask.max().item<int>() == 0);
  CHECK(scene.truth->scene_from_object.sizes() == torch::IntArrayRef({19, 0, 4, 4}));
}

TEST_CASE("every seed makes a medley of its own, of one to three parts that move and are seen") {
  SyntheticOptions options;
  options.frames = 40;
  options.val_frames = options.edit_frames = 0;
  options.width = 32;
  options.height = 18;
  options.samples_per_side = 1;
  std::set<std::vector<std::string>> casts;
  std::set<std::string> motions;
  for (options.seed = 1; options.seed <= 12; ++options.seed) {
    INFO(options.seed);
    const Scene scene = MakeSyntheticScene("medley", options);
    const std::vector<std::string>& parts = scene.truth->objects;
    REQUIRE(!parts.empty());
    REQUIRE(parts.size() <= 3);
    casts.insert(parts);
    for (size_t k = 0; k < parts.size(); ++k) {
      INFO(parts[k]);
      motions.insert(parts[k].substr(7));
      const auto poses = scene.truth->scene_from_object.select(1, static_cast<int64_t>(k));
      CHECK((poses - poses[0]).abs().flatten(1).amax(1).max().item<double>() > 0.03);
      const auto seen = (scene.truth->mask == static_cast<int64_t>(k + 1)).flatten(1).any(1);
      CHECK(seen.sum().item<int64_t>() > 20);
    }
  }
  CHECK(casts.size() > 6);
  CHECK(motions == std::set<std::string>{"rises", "roams", "slides", "turns"});
}

TEST_CASE("a key sinks exactly while the hammer presses it") {
  SyntheticOptions options = Small();
  options.frames = 60;
  options.width = 16;
  options.height = 9;
  options.val_frames = options.edit_frames = 0;
  const Scene scene = Make("keys", options);
  REQUIRE(scene.truth->objects == std::vector<std::string>{"hammer", "key_0", "key_1", "key_2", "key_3", "key_4"});
  const auto poses = scene.truth->scene_from_object;
  const auto height = poses.select(1, 0).select(1, 2).select(1, 3);        // of the hammer
  const auto sunk = poses.slice(1, 1, 6).select(2, 2).select(2, 1).abs();  // sine of each key's angle, scaled
  const auto pressed = sunk.amax(1) > 1e-6;
  CHECK(pressed.any().item<bool>());
  CHECK_FALSE(pressed.all().item<bool>());
  CHECK((sunk.amax(0) > 1e-3).all().item<bool>());  // every key has its turn
  CHECK(height.masked_select(pressed).max().item<double>() <
        height.masked_select(~pressed).min().item<double>() + 1e-9);
}

TEST_CASE("the cups lift off, move alone and together, and return to states they had") {
  SyntheticOptions options = Small();
  options.frames = 100;
  options.width = 16;
  options.height = 9;
  options.val_frames = options.edit_frames = 0;
  const Scene scene = Make("cups", options);
  const auto place = scene.truth->scene_from_object.slice(3, 3, 4).slice(2, 0, 3).squeeze(3);  // [F, 2, 3]
  const auto moves = (place.slice(0, 1) - place.slice(0, 0, -1)).norm(2, 2) > 1e-4;
  const auto left = moves.select(1, 0), right = moves.select(1, 1);
  CHECK((left & ~right).sum().item<int64_t>() > 10);
  CHECK((~left & right).sum().item<int64_t>() > 10);
  CHECK((left & right).sum().item<int64_t>() > 10);
  CHECK((~left & ~right).sum().item<int64_t>() > 0);
  const auto range = (place.amax(0) - place.amin(0)) / scene.transform.scale;
  CHECK(range.min().item<double>() > 0.3);  // along every axis, world units
  CHECK((place[0] - place[99]).norm().item<double>() < 0.01);
}

TEST_CASE("synthetic scenes repeat for a seed and differ between seeds") {
  SyntheticOptions options = Small();
  options.frames = 3;
  const Scene a = Make("cups", options), b = Make("cups", options);
  CHECK(torch::equal(a.images, b.images));
  CHECK(torch::equal(a.points, b.points));
  CHECK(torch::equal(a.truth->depth, b.truth->depth));
  CHECK(a.transform.near == b.transform.near);
  options.seed = 1;
  CHECK_FALSE(torch::equal(a.images, Make("cups", options).images));
}
