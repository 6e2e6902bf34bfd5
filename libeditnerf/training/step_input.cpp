#include "libeditnerf/training/step_input.h"

#include "libeditnerf/base/error.h"

namespace editnerf {
namespace {

namespace fs = std::filesystem;
using Tensors = std::map<std::string, torch::Tensor>;

// Calls visit(name, tensor) for everything random of a step. One list for writing and reading; what RayOptions shares
// with the batch is there once.
template <class Input, class Visit>
void VisitTensors(Input& input, const Visit& visit) {
  visit("origin", input.batch.rays.origin);
  visit("direction", input.batch.rays.direction);
  visit("frame", input.batch.frame);
  visit("target", input.batch.target);
  visit("emphasis", input.batch.emphasis);
  visit("distance", input.batch.distance);
  visit("tolerance", input.batch.tolerance);
  visit("start", input.batch.start);
  visit("carrier", input.batch.carrier);
  visit("background", input.options.background);
  visit("jitter", input.options.jitter);
  visit("state", input.state);
  visit("drawn", input.drawn);
  visit("generator", input.generator);
}

}  // namespace

void SaveStep(const Run& run, const StepInput& input, const std::optional<KeyPointSupervision>& supervision,
              const fs::path& folder) {
  Tensors extra;
  VisitTensors(input, [&](const char* name, const torch::Tensor& tensor) {
    if (tensor.defined()) extra[std::string("step.") + name] = tensor.detach();
  });
  const RayOptions& o = input.options;
  extra["step.options"] = torch::tensor({static_cast<int64_t>(o.surface), static_cast<int64_t>(o.distortion),
                                         static_cast<int64_t>(o.distance.defined()), o.march_steps},
                                        torch::kInt64);
  if (supervision) {
    extra["supervision.flow"] = supervision->flow;
    extra["supervision.depth"] = supervision->depth;
  }
  SaveRun(run, folder, extra);
}

StoredStep LoadStep(const fs::path& folder, torch::Device device) {
  LoadedRun loaded = LoadRunWithExtra(folder, device, Weights::kAsTheyAre);
  const auto find = [&](const std::string& name) {
    const auto found = loaded.extra.find(name);
    if (found == loaded.extra.end()) return torch::Tensor();
    return name == "step.generator" ? found->second : found->second.to(device);
  };
  StoredStep step;
  step.run = std::move(loaded.run);
  StepInput& input = step.input;
  VisitTensors(input, [&](const char* name, torch::Tensor& tensor) { tensor = find(std::string("step.") + name); });
  const torch::Tensor options = find("step.options");
  for (const auto& tensor : {options, input.batch.rays.origin, input.batch.rays.direction, input.batch.frame,
                             input.batch.target, input.state}) {
    if (!tensor.defined()) {
      Throw<CheckpointError>("{}: no step of training lies here; expected one of RUN/bad_steps (dump_bad_steps)",
                             folder.string());
    }
  }
  input.batch.drawn = input.drawn.defined() ? input.drawn.size(0) : 0;
  input.options.training = true;
  input.options.surface = options[0].item<int64_t>() != 0;
  input.options.distortion = options[1].item<int64_t>() != 0;
  if (options[2].item<int64_t>() != 0) {
    input.options.distance = input.batch.distance;
    input.options.tolerance = input.batch.tolerance;
  }
  input.options.march_steps = options[3].item<int64_t>();
  if (input.drawn.defined()) input.options.start = input.batch.start;
  if (const torch::Tensor flow = find("supervision.flow"); flow.defined()) {
    step.supervision = KeyPointSupervision{};
    step.supervision->flow = flow;
    step.supervision->depth = find("supervision.depth");
  }
  return step;
}

}  // namespace editnerf
