#include "libeditnerf/tracking/flow_cache.h"

#include <map>
#include <optional>
#include <string>

#include "libeditnerf/base/digest.h"
#include "libeditnerf/base/error.h"
#include "libeditnerf/base/file.h"
#include "libeditnerf/base/logging.h"
#include "libeditnerf/base/safetensors.h"
#include "libeditnerf/base/shape.h"

namespace editnerf {
namespace {

constexpr const char* kFormat = "editnerf-flow-1";

std::map<std::string, std::string> Key(const torch::Tensor& images, const OpticalFlow& flow) {
  Digest digest;
  digest.Add(images);
  return {{"format", kFormat}, {"flow", flow.Identity()}, {"images", digest.Text()}};
}

std::optional<FlowSequence> Read(const std::filesystem::path& path, const std::map<std::string, std::string>& key,
                                 const torch::Tensor& images) {
  if (!std::filesystem::exists(path)) return std::nullopt;
  try {
    if (ReadSafetensorsMetadata(path) != key) return std::nullopt;
    SafetensorsFile file = ReadSafetensors(path);
    FlowSequence sequence;
    sequence.forward = file.tensors["forward"];
    sequence.backward = file.tensors["backward"];
    const std::string name = path.string() + ": kept flow";
    for (const torch::Tensor& flow : {sequence.forward, sequence.backward}) {
      CheckShape(flow, {images.size(0) - 1, images.size(1), images.size(2), 2}, name.c_str());
      if (flow.scalar_type() == torch::kFloat32) continue;
      Throw<DataError>("{}: expected float32, found {}", name, c10::toString(flow.scalar_type()));
    }
    Validate(&sequence);
    return sequence;
  } catch (const Error& error) {
    LogWarning("{}; optical flow is computed again", error.what());
    return std::nullopt;
  }
}

}  // namespace

FlowSequence CachedFlowSequence(const torch::Tensor& images, const OpticalFlow& flow, const std::filesystem::path& path,
                                bool keep) {
  const auto key = Key(images, flow);
  if (auto kept = Read(path, key, images)) {
    LogInfo("optical flow read from {}", path.string());
    return *kept;
  }
  FlowSequence sequence = ComputeFlowSequence(images, flow);
  if (keep) {
    MakeFolder(path.parent_path());
    WriteSafetensors(path, {{"forward", sequence.forward}, {"backward", sequence.backward}}, key);
  }
  return sequence;
}

std::filesystem::path FlowCachePath(const std::filesystem::path& run_folder) {
  return run_folder / "optical_flow.safetensors";
}

}  // namespace editnerf
