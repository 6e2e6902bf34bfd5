#include "libeditnerf/scene/synthetic/synthetic_scene.h"

#include <fmt/ranges.h>
#include <torch/types.h>

#include <algorithm>
#include <limits>

#include "libeditnerf/base/error.h"
#include "libeditnerf/base/progress.h"
#include "libeditnerf/scene/synthetic/stage.h"

namespace editnerf {
namespace {

using namespace synthetic;

// Neither 1 nor the origin, so that a mistake of frames or units shows. The farthest point that a camera sees and the
// cameras themselves stay within about one scene unit.
const SceneTransform kTransform = {0.23, {0.21, -0.47, 0.63}, 0, 0};
constexpr double kDepthMargin = 0.05;  // of near and far, relative
constexpr uint64_t kPointsPerFrame = 40;
constexpr uint64_t kEditCameras = 100000;  // numbers of novel cameras that validation frames do not use

struct NamedPlay {
  const char* name;
  Play (*make)(uint64_t seed);
};
template <Play (*make)()>
Play Whatever(uint64_t /*seed*/) {
  return make();
}
constexpr NamedPlay kPlays[] = {{"hinge", Whatever<HingePlay>},   {"keys", Whatever<KeysPlay>},
                                {"cups", Whatever<CupsPlay>},     {"cabinet", Whatever<CabinetPlay>},
                                {"static", Whatever<StaticPlay>}, {"medley", MedleyPlay}};

// What one frame shows.
struct Shot {
  State state;
  Camera camera;  // world
  int64_t state_id = -1;
};

void CheckOptions(const SyntheticOptions& options) {
  const auto within = [](const char* field, int64_t value, int64_t low, int64_t high) {
    if (value < low || value > high) {
      Throw<ConfigError>("synthetic scene: {}: expected {} to {}, found {}", field, low, high, value);
    }
  };
  within("frames", options.frames, 2, 100000);
  within("val_frames", options.val_frames, 0, 100000);
  within("edit_frames", options.edit_frames, 0, 1000);
  within("slide_frames", options.slide_frames, 0, 1000);
  within("width", options.width, 8, 8192);
  within("height", options.height, 8, 8192);
  within("samples_per_side", options.samples_per_side, 1, 16);
}

std::vector<Shot> PlanShots(const Play& play, const SyntheticOptions& options) {
  CameraPathOptions path = play.camera;
  path.width = options.width;
  path.height = options.height;
  path.seed = options.seed;
  const auto time_of = [&](int64_t frame) {
    return static_cast<double>(frame) / static_cast<double>(options.frames - 1);
  };
  std::vector<Shot> shots;
  std::vector<State> visited;
  for (int64_t frame = 0; frame < options.frames; ++frame) {
    visited.push_back(StateAt(play.tracks, time_of(frame)));
    shots.push_back({visited.back(), TrainingCamera(path, time_of(frame)), frame});
  }
  for (int64_t k = 0; k < options.val_frames; ++k) {
    const int64_t frame = (2 * k + 1) * options.frames / (2 * options.val_frames);
    shots.push_back(
        {visited[static_cast<size_t>(frame)], NovelCamera(path, time_of(frame), static_cast<uint64_t>(k)), frame});
  }
  if (play.tracks.empty()) return shots;
  const std::vector<State> unseen = UnseenStates(visited, play.tracks, options.edit_frames, options.seed);
  for (size_t k = 0; k < unseen.size(); ++k) {
    const double time = (static_cast<double>(k) + 0.5) / static_cast<double>(unseen.size());
    shots.push_back({unseen[k], NovelCamera(path, time, kEditCameras + k), -1});
  }
  const Camera resting = NovelCamera(path, 0.5, kEditCameras + unseen.size());
  for (const State& state : SlidingStates(visited, play.tracks, options.slide_frames)) {
    shots.push_back({state, resting, -1});
  }
  return shots;
}

Vec3 ToScene(const Vec3& world) { return (world - kTransform.center) * kTransform.scale; }

// S M S^-1, with S = scene_from_world: a rigid motion in scene units.
void StorePose(const Pose& world_from_object, double* matrix) {
  const Vec3 translation = ToScene(world_from_object.rotation * kTransform.center + world_from_object.translation);
  const double column[3] = {translation.x, translation.y, translation.z};
  for (int row = 0; row < 3; ++row) {
    for (int c = 0; c < 3; ++c) matrix[4 * row + c] = world_from_object.rotation(row, c);
    matrix[4 * row + 3] = column[row];
  }
  matrix[15] = 1;
}

// Appends points of static surfaces that a camera (scene units) sees through random pixels.
void SampleBackground(const Camera& camera, const float* depth, const uint8_t* mask, uint64_t seed,
                      std::vector<float>* points) {
  const auto pixels = static_cast<double>(camera.width * camera.height);
  for (uint64_t k = 0; k < kPointsPerFrame; ++k) {
    const auto i = static_cast<int64_t>(HashUnit(seed, k, 61) * pixels);
    if (mask[i] != 0 || !std::isfinite(depth[i])) continue;
    const int64_t column = i % camera.width, row = i / camera.width;
    const double x = static_cast<double>(column) + 0.5, y = static_cast<double>(row) + 0.5;
    const Vec3 point = camera.position + camera.DirectionThrough(x, y) * depth[i];
    for (const double value : {point.x, point.y, point.z}) points->push_back(static_cast<float>(value));
  }
}

}  // namespace

std::vector<std::string> SyntheticSceneNames() {
  std::vector<std::string> names;
  for (const NamedPlay& play : kPlays) names.emplace_back(play.name);
  return names;
}

Scene MakeSyntheticScene(const std::string& name, const SyntheticOptions& options) {
  CheckOptions(options);
  const auto found =
      std::find_if(std::begin(kPlays), std::end(kPlays), [&](const NamedPlay& known) { return name == known.name; });
  if (found == std::end(kPlays)) {
    Throw<ConfigError>("no synthetic scene is named '{}'; known are {}", name, fmt::join(SyntheticSceneNames(), ", "));
  }
  const Play play = found->make(options.seed);
  const std::vector<Shot> shots = PlanShots(play, options);
  const auto count = static_cast<int64_t>(shots.size());
  const int64_t height = options.height, width = options.width, pixels = height * width;

  Scene scene;
  scene.name = name;
  scene.transform = kTransform;
  scene.images = torch::empty({count, height, width, 3}, torch::kUInt8);
  GroundTruth truth;
  for (const Body& body : play.bodies)
    if (body.moves) truth.objects.push_back(body.name);
  const auto num_objects = static_cast<int64_t>(truth.objects.size());
  truth.scene_from_object = torch::zeros({count, num_objects, 4, 4}, torch::kFloat64);
  truth.depth = torch::empty({count, height, width}, torch::kFloat32);
  truth.mask = torch::zeros({count, height, width}, torch::kUInt8);

  double* matrices = truth.scene_from_object.data_ptr<double>();
  double nearest = std::numeric_limits<double>::infinity(), farthest = 0;
  std::vector<float> points;
  Progress progress("drawing " + name, static_cast<double>(count));
  for (int64_t f = 0; f < count; ++f) {
    const Shot& shot = shots[static_cast<size_t>(f)];
    const std::vector<Pose> moving = play.poses(shot.state);
    std::vector<Pose> poses(play.bodies.size());
    std::vector<uint8_t> label(play.bodies.size(), 0);
    for (size_t b = 0, object = 0; b < play.bodies.size(); ++b) {
      if (!play.bodies[b].moves) continue;
      poses[b] = moving[object];
      StorePose(poses[b], matrices);
      matrices += 16;
      label[b] = static_cast<uint8_t>(++object);
    }
    const PlacedStage stage(play.bodies, poses, play.light);
    const uint64_t noise_seed = options.seed * 1000003 + static_cast<uint64_t>(f);
    const View view = RenderView(stage, shot.camera, options.samples_per_side, noise_seed);

    std::copy(view.rgb.begin(), view.rgb.end(), scene.images.data_ptr<uint8_t>() + 3 * f * pixels);
    float* depth = truth.depth.data_ptr<float>() + f * pixels;
    uint8_t* mask = truth.mask.data_ptr<uint8_t>() + f * pixels;
    for (int64_t i = 0; i < pixels; ++i) {
      const auto k = static_cast<size_t>(i);
      depth[i] = static_cast<float>(view.depth[k] * kTransform.scale);
      if (view.body[k] < 0) continue;
      mask[i] = label[static_cast<size_t>(view.body[k])];
      nearest = std::min(nearest, view.depth[k]);
      farthest = std::max(farthest, view.depth[k]);
    }

    SceneFrame frame;
    frame.id = fmt::format("{:06}", f);
    frame.warp_id = frame.appearance_id = shot.state_id;
    frame.camera = shot.camera;
    frame.camera.position = ToScene(shot.camera.position);
    scene.frames.push_back(frame);
    (f < options.frames ? scene.train : shot.state_id >= 0 ? scene.val : scene.edit).push_back(f);

    if (f < options.frames) SampleBackground(frame.camera, depth, mask, noise_seed, &points);
    progress.Update(static_cast<double>(f + 1));
  }
  scene.transform.near = nearest * kTransform.scale * (1 - kDepthMargin);
  scene.transform.far = farthest * kTransform.scale * (1 + kDepthMargin);
  scene.points = torch::tensor(points).view({static_cast<int64_t>(points.size() / 3), 3});
  scene.truth = std::move(truth);
  scene.Check();
  return scene;
}

}  // namespace editnerf
