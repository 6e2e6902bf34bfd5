#include "libeditnerf/tracking/pretrained_maps.h"

#include <map>
#include <nlohmann/json.hpp>
#include <string>

#include "libeditnerf/base/error.h"
#include "libeditnerf/base/safetensors.h"

namespace editnerf {
namespace {

constexpr const char* kFileName = "surface_maps.safetensors";
constexpr const char* kFormat = "editnerf-surface-maps-1";

std::string TrainingIds(const Scene& scene) {
  nlohmann::json ids = nlohmann::json::array();
  for (const int64_t index : scene.train) ids.push_back(scene.frames[static_cast<size_t>(index)].id);
  return ids.dump();
}

}  // namespace

PretrainedMaps ReadPretrainedMaps(const std::filesystem::path& run_folder, const Scene& scene) {
  const std::filesystem::path path = run_folder / kFileName;
  if (!std::filesystem::exists(path)) {
    Throw<DataError>("{}: not found; run enf-pretrain on the scene to the end first", path.string());
  }
  const auto file = ReadSafetensors(path);
  const auto ids = file.metadata.find("training_ids");
  if (ids == file.metadata.end() || ids->second != TrainingIds(scene)) {
    Throw<DataError>(
        "{}: made for other training frames than those of {}; pretrain on this scene with these data settings",
        path.string(), scene.name);
  }
  PretrainedMaps maps;
  const auto take = [&](const char* name) {
    const auto found = file.tensors.find(name);
    return found == file.tensors.end() ? torch::Tensor() : found->second.to(torch::kFloat32).contiguous();
  };
  maps.depth = take("depth");
  maps.ambient = take("ambient");
  maps.x_canonical = take("x_canonical");
  maps.Check(scene);
  return maps;
}

void WritePretrainedMaps(const PretrainedMaps& maps, const Scene& scene, const std::filesystem::path& run_folder) {
  maps.Check(scene);
  std::map<std::string, torch::Tensor> tensors = {{"depth", maps.depth.cpu().to(torch::kFloat32).contiguous()},
                                                  {"ambient", maps.ambient.cpu().to(torch::kFloat32).contiguous()}};
  if (maps.x_canonical.defined()) tensors["x_canonical"] = maps.x_canonical.cpu().to(torch::kFloat32).contiguous();
  WriteSafetensors(run_folder / kFileName, tensors, {{"format", kFormat}, {"training_ids", TrainingIds(scene)}});
}

}  // namespace editnerf
