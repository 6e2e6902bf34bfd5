#include "libeditnerf/training/saved_state.h"

#include "libeditnerf/base/error.h"
#include "libeditnerf/base/shape.h"

namespace editnerf {

void LoadInto(const SavedState& state, const std::string& key, const torch::Tensor& target) {
  const auto found = state.find(key);
  if (found == state.end()) Throw<CheckpointError>("training state: '{}' is missing", key);
  if (found->second.sizes() != target.sizes()) {
    Throw<CheckpointError>("training state: '{}': expected shape {}, found {}", key, ShapeString(target),
                           ShapeString(found->second));
  }
  target.copy_(found->second);
}

SavedState Under(const std::string& prefix, const SavedState& state) {
  SavedState part;
  for (auto item = state.lower_bound(prefix); item != state.end() && item->first.rfind(prefix, 0) == 0; ++item) {
    part[item->first.substr(prefix.size())] = item->second;
  }
  return part;
}

void PutUnder(const std::string& prefix, const SavedState& part, SavedState* state) {
  for (const auto& [name, tensor] : part) (*state)[prefix + name] = tensor;
}

}  // namespace editnerf
