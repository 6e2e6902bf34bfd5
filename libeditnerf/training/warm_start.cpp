#include "libeditnerf/training/warm_start.h"

#include <string>

#include "libeditnerf/base/error.h"

namespace editnerf {
namespace {

constexpr const char* kFirstLayer = "fine.density_network.hidden0.weight";  // [width, canonical features, ...]

bool IsShared(const std::string& name) {
  return name == "fine.canonical_table" || name.rfind("fine.density_network.", 0) == 0 ||
         name.rfind("fine.color_network.", 0) == 0;
}

bool SameSizes(const torch::Tensor* a, const torch::Tensor* b) {
  return a != nullptr && b != nullptr && a->sizes() == b->sizes();
}

}  // namespace

int64_t TakeOverStaticScene(const Run& pretrained, Run* run) {
  if (pretrained.stage != FieldStage::kPretrain) {
    Throw<ConfigError>("warm start: expected a run of enf-pretrain, found one of enf-train");
  }
  const torch::NoGradGuard no_grad;
  const auto from = pretrained.field->named_parameters(), from_buffers = pretrained.field->named_buffers();
  auto to = run->field->named_parameters(), to_buffers = run->field->named_buffers();
  const torch::Tensor *const low = from_buffers.find("fine.box_low"), *const own_low = to_buffers.find("fine.box_low");
  const torch::Tensor *const table = from.find("fine.canonical_table"), *const own = to.find("fine.canonical_table");
  if (!SameSizes(table, own) || !SameSizes(low, own_low) || !low->allclose(own_low->to(low->device()))) return 0;
  const int64_t features = table->size(0) * table->size(2);
  int64_t taken = 0;
  for (auto& item : to) {
    const torch::Tensor* const source = from.find(item.key());
    if (source == nullptr || !IsShared(item.key())) continue;
    const bool first = item.key() == kFirstLayer && source->size(0) == item.value().size(0);
    if (!first && source->sizes() != item.value().sizes()) continue;
    torch::Tensor target = first ? item.value().slice(1, 0, features) : item.value();
    target.copy_(first ? source->slice(1, 0, features) : *source);
    taken += target.numel();
  }
  return taken;
}

}  // namespace editnerf
