// Weights and images of RAFT by formulas, the same as in raft_reference.py, under torchvision's names.
#pragma once

#include <torch/types.h>

#include <cmath>
#include <cstdint>
#include <fstream>
#include <map>
#include <numeric>
#include <sstream>
#include <string>
#include <vector>

#include "libeditnerf/tracking/raft/weights.h"

namespace editnerf::testing {

// Seeded by the name in raft/network.h.
inline torch::Tensor MadeUpRaftWeight(const std::string& name, const std::vector<int64_t>& shape) {
  int64_t seed = 0;
  for (size_t i = 0; i < name.size(); ++i) seed = (seed + static_cast<int64_t>(i + 1) * name[i]) % 1009;
  const int64_t count = std::accumulate(shape.begin(), shape.end(), int64_t{1}, std::multiplies<int64_t>());
  const torch::Tensor wave = torch::sin(torch::arange(count, torch::kFloat64) * 2.399 + static_cast<double>(seed));
  const auto has = [&](const char* text) { return name.find(text) != std::string::npos; };
  torch::Tensor values = 0.1 * wave;
  if (shape.size() == 4) values = wave * std::sqrt(2.0 * static_cast<double>(shape[0]) / static_cast<double>(count));
  if (has("running_var") || ((has(".norm") || has("downsample.1")) && has("weight"))) values = 1 + 0.3 * wave;
  return values.view(shape).to(torch::kFloat32);
}

// network: "small" or "large".
inline std::map<std::string, torch::Tensor> MadeUpRaftWeights(const std::string& network) {
  std::map<std::string, torch::Tensor> tensors;
  std::ifstream lines(std::string(EDITNERF_SOURCE_DIR) + "/tests/tracking/raft_names.txt");
  for (std::string line; std::getline(lines, line);) {
    std::istringstream words(line);
    std::string title, name;
    words >> title >> name;
    if (title != network) continue;
    std::vector<int64_t> shape;
    for (int64_t size = 0; words >> size;) shape.push_back(size);
    const bool counter = name.find("num_batches_tracked") != std::string::npos;
    tensors[name] = counter ? torch::zeros({}, torch::kInt64) : MadeUpRaftWeight(RaftParameterName(name), shape);
  }
  return tensors;
}

// [1, 3, 128, 136] in [-1, 1].
inline torch::Tensor MadeUpRaftImage(double shift) {
  const torch::Tensor y = torch::arange(128, torch::kFloat64).view({1, -1, 1}) + 2 * shift;
  const torch::Tensor x = torch::arange(136, torch::kFloat64).view({1, 1, -1}) - 3 * shift;
  const torch::Tensor c = torch::arange(3, torch::kFloat64).view({-1, 1, 1});
  const torch::Tensor value = torch::sin(0.21 * x + 0.13 * y + c) + torch::sin(0.17 * y - 0.07 * x + 2 * c) +
                              torch::sin(0.5 * x) * torch::sin(0.4 * y);
  return (value / 3).to(torch::kFloat32).unsqueeze(0);
}

}  // namespace editnerf::testing
