#include "libeditnerf/tracking/raft/weights.h"

#include <torch/types.h>
#include <torch/utils.h>

#include <array>
#include <map>
#include <regex>

#include "libeditnerf/base/error.h"
#include "libeditnerf/base/pth_archive.h"
#include "libeditnerf/base/safetensors.h"
#include "libeditnerf/base/shape.h"

namespace editnerf {
namespace {

using Tensors = std::map<std::string, torch::Tensor>;

struct Rename {
  std::regex pattern;
  const char* name;
};

// torchvision's names to the authors', and a number for the recurrent unit's only pass.
const std::array<Rename, 15>& Renames() {
  static const std::array<Rename, 15> renames = {
      {{std::regex("^module\\."), ""},
       {std::regex("^feature_encoder\\."), "fnet."},
       {std::regex("^context_encoder\\."), "cnet."},
       {std::regex("^([fc]net)\\.conv\\."), "$1.conv2."},
       {std::regex("^([fc]net)\\.convnormrelu\\.0\\."), "$1.conv1."},
       {std::regex("^([fc]net)\\.convnormrelu\\.1\\."), "$1.norm1."},
       {std::regex("\\.convnormrelu([123])\\.0\\."), ".conv$1."},
       {std::regex("\\.convnormrelu([123])\\.1\\."), ".norm$1."},
       {std::regex("\\.motion_encoder\\.conv\\.0\\."), ".encoder.conv."},
       {std::regex("\\.motion_encoder\\.convcorr([12])\\.0\\."), ".encoder.convc$1."},
       {std::regex("\\.motion_encoder\\.convflow([12])\\.0\\."), ".encoder.convf$1."},
       {std::regex("\\.recurrent_block\\.convgru([12])\\.conv([zrq])\\."), ".gru.conv$2$1."},
       {std::regex("\\.gru\\.conv([zrq])\\."), ".gru.conv$011."},
       {std::regex("^mask_predictor\\.convrelu\\.0\\."), "update_block.mask.0."},
       {std::regex("^mask_predictor\\.conv\\."), "update_block.mask.2."}}};
  return renames;
}

// Counters of training, and the shortcut's normalisation, which the authors' files hold under two names.
bool IsSpare(const std::string& name) {
  static const std::regex pattern("num_batches_tracked$|^[fc]net\\.layer[123]\\.0\\.norm[34]\\.");
  return std::regex_search(name, pattern);
}

Tensors ReadTensors(const std::filesystem::path& path) {
  if (path.extension() != ".safetensors") return ReadPthArchive(path);
  try {
    return ReadSafetensors(path).tensors;
  } catch (const CheckpointError& error) {  // here an input, not a checkpoint
    throw DataError(error.what());
  }
}

void CopyInto(torch::Tensor target, const std::string& name, Tensors* tensors, const std::string& where) {
  const auto found = tensors->find(name);
  if (found == tensors->end()) Throw<DataError>("{}: no tensor '{}': not the weights of RAFT", where, name);
  if (found->second.sizes() != target.sizes()) {
    Throw<DataError>("{}: tensor '{}' has shape {}, expected {}", where, name, ShapeString(found->second),
                     ShapeString(target));
  }
  if (!found->second.isfinite().all().item<bool>()) {
    Throw<DataError>("{}: tensor '{}' holds values that are not finite", where, name);
  }
  target.copy_(found->second);
  tensors->erase(found);
}

}  // namespace

std::string RaftParameterName(const std::string& published) {
  std::string name = published;
  for (const Rename& rename : Renames()) name = std::regex_replace(name, rename.pattern, rename.name);
  return name;
}

Raft LoadRaft(const std::filesystem::path& path) {
  const torch::NoGradGuard no_grad;
  const std::string where = path.string();
  Tensors tensors;
  for (const auto& [published, tensor] : ReadTensors(path)) tensors[RaftParameterName(published)] = tensor;
  const auto first = tensors.find("fnet.conv1.weight");
  if (first == tensors.end()) Throw<DataError>("{}: no tensor 'fnet.conv1.weight': not the weights of RAFT", where);
  const bool large = first->second.dim() > 0 && first->second.size(0) == RaftShape::Large().widths[0];
  Raft raft(large ? RaftShape::Large() : RaftShape::Small());
  for (const auto& parameter : raft->named_parameters()) CopyInto(parameter.value(), parameter.key(), &tensors, where);
  for (const auto& buffer : raft->named_buffers()) {
    if (!IsSpare(buffer.key())) CopyInto(buffer.value(), buffer.key(), &tensors, where);
  }
  for (const auto& [name, tensor] : tensors) {
    if (!IsSpare(name)) {
      Throw<DataError>("{}: tensor '{}' has no place in the {} network of RAFT", where, name,
                       large ? "large" : "small");
    }
  }
  for (auto& parameter : raft->parameters()) parameter.set_requires_grad(false);
  raft->eval();
  return raft;
}

}  // namespace editnerf
