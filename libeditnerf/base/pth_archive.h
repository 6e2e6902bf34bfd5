// Weights as their authors publish them: files written by Python's torch.save, both layouts.
//   legacy: pickles one after the other (magic number, protocol, system, the dict, storage keys), then the raw storages
//   zip:    ARCHIVE/data.pkl and one stored entry ARCHIVE/data/KEY per storage
//
// Reading executes nothing (restricted_pickle.h), and every length is checked against the file before memory is taken.
#pragma once

#include <torch/types.h>

#include <filesystem>
#include <map>
#include <string>

namespace editnerf {

// The tensors of a state dict by name, on the CPU, in the file's dtypes. Tensors that share a storage in the file share
// it here. Throws DataError naming the file: not such a file, truncated, a type that is not allowed, big-endian data,
// an entry that is not a tensor.
std::map<std::string, torch::Tensor> ReadPthArchive(const std::filesystem::path& path);

}  // namespace editnerf
