// Learned perceptual image distance: LPIPS v0.1 with SqueezeNet 1.1 (Zhang et al., "The Unreasonable Effectiveness of
// Deep Features as a Perceptual Metric", CVPR 2018).
//
// Seven feature maps of the network (after its first layer and after fire modules 4, 7, 9, 10, 11 and 12), each scaled
// to unit length over its channels; squared differences, weighted per channel by the published heads, averaged over the
// image, summed over the maps. 0 for identical images; larger is less alike.
//
// The weights are not part of this library: users fetch the two files from their authors.
#pragma once

#include <torch/nn/module.h>
#include <torch/nn/modules/conv.h>
#include <torch/nn/pimpl.h>
#include <torch/types.h>

#include <filesystem>
#include <map>
#include <string>
#include <vector>

namespace editnerf {

// 1 x 1 kernels that squeeze the channels, then 1 x 1 and 3 x 3 kernels side by side, a ReLU after each.
class FireImpl : public torch::nn::Module {
 public:
  FireImpl(int64_t in_channels, int64_t squeeze_channels, int64_t expand_channels);

  torch::Tensor forward(const torch::Tensor& x);  // [B, in, H, W] -> [B, 2 expand, H, W]

 private:
  torch::nn::Conv2d squeeze_ = nullptr, expand1x1_ = nullptr, expand3x3_ = nullptr;
};
TORCH_MODULE(Fire);

class LpipsImpl : public torch::nn::Module {
 public:
  LpipsImpl();  // weights are arbitrary until Load

  // Copies both files' tensors. The backbone's names may begin with "features."; tensors of its classifier are ignored.
  // Throws DataError, beginning with `where`, naming a tensor that is missing or of another shape.
  void Load(const std::map<std::string, torch::Tensor>& backbone, const std::map<std::string, torch::Tensor>& linear,
            const std::string& where);

  // a, b [B, 3, H, W] in [-1, 1] -> [B] distances; differentiable. Throws ShapeError below 17 pixels a side.
  torch::Tensor forward(const torch::Tensor& a, const torch::Tensor& b);

  // a, b [H, W, 3] in [0, 1]; without gradients, on this module's device.
  double Distance(const torch::Tensor& a, const torch::Tensor& b);

 private:
  std::vector<torch::Tensor> Features(const torch::Tensor& images);

  torch::Tensor shift_, scale_;  // [3, 1, 1] of the input's colours
  torch::nn::Conv2d first_ = nullptr;
  std::vector<Fire> fires_;           // modules 3, 4, 6, 7, 9, 10, 11, 12 of the published network
  std::vector<torch::Tensor> heads_;  // [1, C, 1, 1] each
};
TORCH_MODULE(Lpips);

// Reads the two published files (pth_archive.h): the SqueezeNet 1.1 backbone and the v0.1 linear heads for it.
Lpips LoadLpips(const std::filesystem::path& backbone, const std::filesystem::path& linear);

}  // namespace editnerf
