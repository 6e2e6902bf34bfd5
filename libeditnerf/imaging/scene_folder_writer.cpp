#include "libeditnerf/imaging/scene_folder_writer.h"

#include <string>
#include <vector>

#include "libeditnerf/base/error.h"
#include "libeditnerf/base/file.h"
#include "libeditnerf/base/parallel.h"
#include "libeditnerf/base/shape.h"
#include "libeditnerf/imaging/camera_file.h"
#include "libeditnerf/imaging/image_file.h"
#include "libeditnerf/imaging/json_file.h"
#include "libeditnerf/imaging/npy_file.h"
#include "libeditnerf/imaging/scene_folder.h"
#include "libeditnerf/imaging/truth_files.h"
#include "libeditnerf/scene/scene_json.h"

namespace editnerf {
namespace fs = std::filesystem;
namespace {

std::vector<std::string> IdsOf(const Scene& scene, const std::vector<int64_t>& split) {
  std::vector<std::string> ids;
  for (const int64_t index : split) ids.push_back(scene.frames[static_cast<size_t>(index)].id);
  return ids;
}

}  // namespace

void RemoveStaleSceneFiles(const fs::path& folder) {
  std::error_code ignored;
  fs::remove(folder / "dataset.json", ignored);
  fs::remove(folder / "points.npy", ignored);
  fs::remove(folder / "data" / "k_points_auto.txt", ignored);
  fs::remove_all(folder / "depth", ignored);
  fs::remove_all(folder / "flow", ignored);
  fs::remove(folder / "gt" / "edits.json", ignored);
  fs::remove(folder / "gt" / "motion.json", ignored);
  fs::remove_all(folder / "gt" / "depth", ignored);
  fs::remove_all(folder / "gt" / "mask", ignored);
  if (!fs::is_directory(folder / "rgb")) return;
  std::vector<fs::path> downsampled;
  for (const auto& entry : fs::directory_iterator(folder / "rgb")) {
    const std::string name = entry.path().filename().string();
    const bool numbered = name.size() > 1 && name.find_first_not_of("0123456789") == name.size() - 1;
    if (numbered && name.back() == 'x' && name != "1x") downsampled.push_back(entry.path());
  }
  for (const fs::path& path : downsampled) fs::remove_all(path, ignored);
}

void WriteSceneDescription(const Scene& scene, const fs::path& folder) {
  MakeFolder(folder / "camera");
  const SceneTransform& transform = scene.transform;
  WriteJson(folder / "scene.json", ToJson(transform));

  std::vector<std::string> ids;
  Json metadata = Json::object();
  for (const SceneFrame& frame : scene.frames) {
    ids.push_back(frame.id);
    WriteCameraFile(folder / "camera" / (frame.id + ".json"), CameraInWorldUnits(frame.camera, transform));
    if (frame.warp_id < 0) continue;
    metadata[frame.id] = {{"warp_id", frame.warp_id}, {"appearance_id", frame.appearance_id}, {"camera_id", 0}};
  }
  WriteJson(folder / "metadata.json", metadata);

  if (scene.points.defined()) {
    const Vec3& c = transform.center;
    const torch::Tensor center = torch::tensor({c.x, c.y, c.z}, torch::kFloat64);
    const torch::Tensor points = scene.points.to(torch::kCPU, torch::kFloat64) / transform.scale + center;
    WriteNpy(folder / "points.npy", points.to(torch::kFloat32));
  }
  if (!scene.edit.empty()) WriteEditIds(folder, IdsOf(scene, scene.edit));
  if (scene.truth) WriteTruth(folder, ids, *scene.truth, transform);

  // Last, so that a folder whose writing was cut short does not pass for a whole one.
  WriteJson(folder / "dataset.json", {{"count", ids.size()},
                                      {"num_exemplars", scene.train.size()},
                                      {"ids", ids},
                                      {"train_ids", IdsOf(scene, scene.train)},
                                      {"val_ids", IdsOf(scene, scene.val)}});
}

void WriteSceneFolder(const Scene& scene, const fs::path& folder) {
  scene.Check();
  MakeFolder(folder);
  RemoveStaleSceneFiles(folder);
  MakeFolder(folder / "rgb" / "1x");
  const torch::Tensor images = scene.images.to(torch::kCPU).contiguous();
  ParallelFor(images.size(0), 1, [&](int64_t begin, int64_t end) {
    for (int64_t i = begin; i < end; ++i) {
      WritePng(folder / "rgb" / "1x" / (scene.frames[static_cast<size_t>(i)].id + ".png"), images[i]);
    }
  });
  WriteSceneDescription(scene, folder);
}

}  // namespace editnerf
