#include "libeditnerf/tracking/raft_flow.h"

#include <torch/types.h>
#include <torch/utils.h>

#include <array>
#include <limits>
#include <utility>
#include <vector>

#include "libeditnerf/base/error.h"
#include "libeditnerf/base/file.h"
#include "libeditnerf/base/safetensors.h"
#include "libeditnerf/imaging/image_file.h"
#include "libeditnerf/imaging/npy_file.h"
#include "libeditnerf/tracking/raft/correlation.h"
#include "libeditnerf/tracking/raft/weights.h"
#include "made_up_raft.h"
#include "tests/catch.h"
#include "tests/imaging/scratch_folder.h"
#include "tests/pickle_writer.h"
#include "tests/shared_data.h"

using namespace editnerf;

namespace {

using Tensors = std::map<std::string, torch::Tensor>;

// What LoadRaft says about a file with these tensors.
std::string MessageFor(const Tensors& tensors) {
  const ScratchFolder folder;
  WriteSafetensors(folder / "raft.safetensors", tensors);
  try {
    LoadRaft(folder / "raft.safetensors");
  } catch (const DataError& error) {
    const std::string message = error.what();
    const size_t begin = message.find("raft.safetensors");
    return begin == std::string::npos ? message : message.substr(begin);
  }
  return "";
}

Raft MadeUpRaft(const std::string& network) {
  const ScratchFolder folder;
  WriteSafetensors(folder / "raft.safetensors", testing::MadeUpRaftWeights(network));
  return LoadRaft(folder / "raft.safetensors");
}

// torch.save's zip layout by hand.
std::string ZipFile(const Tensors& tensors) {
  std::vector<std::pair<std::string, std::string>> dict, entries;
  for (const auto& [name, tensor] : tensors) {
    const torch::Tensor values = tensor.to(torch::kFloat32).contiguous();
    const std::string key = std::to_string(entries.size());
    dict.emplace_back(name, testing::TensorOf(testing::Storage("FloatStorage", key, values.numel()), 0,
                                              values.sizes().vec(), values.strides().vec()));
    entries.emplace_back("raft/data/" + key, std::string(static_cast<const char*>(values.data_ptr()), values.nbytes()));
  }
  entries.emplace_back("raft/data.pkl", testing::DictPickle(dict));
  return testing::StoredZip(entries);
}

// torch.save's legacy layout by hand.
std::string LegacyFile(const Tensors& tensors) {
  std::vector<std::pair<std::string, std::string>> dict, storages;
  for (const auto& [name, tensor] : tensors) {
    const torch::Tensor values = tensor.to(torch::kFloat32).contiguous();
    const std::string key = std::to_string(storages.size());
    dict.emplace_back(name, testing::TensorOf(testing::Storage("FloatStorage", key, values.numel()), 0,
                                              values.sizes().vec(), values.strides().vec()));
    const float* begin = values.data_ptr<float>();
    storages.emplace_back(key, testing::StorageData({begin, begin + values.numel()}));
  }
  return testing::LegacyFile(testing::DictPickle(dict), storages);
}

torch::Tensor NoiseImage(int64_t height, int64_t width) {
  torch::manual_seed(5);
  const torch::Tensor coarse = torch::rand({1, 3, height / 4 + 2, width / 4 + 2}) * 255;
  return torch::upsample_bicubic2d(coarse, {height, width}, false)[0]
      .clamp(0, 255)
      .to(torch::kUInt8)
      .permute({1, 2, 0})
      .contiguous();
}

}  // namespace

TEST_CASE("RAFT has the published numbers of weights") {
  const auto count = [](const RaftShape& shape) {
    int64_t total = 0;
    for (const auto& parameter : Raft(shape)->parameters()) total += parameter.numel();
    return total;
  };
  CHECK(count(RaftShape::Small()) == 990162);
  CHECK(count(RaftShape::Large()) == 5257536);
}

TEST_CASE("RAFT agrees with torchvision's on made-up weights under torchvision's names") {
  struct Reference {
    int64_t row, column;
    double x, y;
  };
  // Printed by raft_reference.py, torchvision 0.14.1.
  const std::vector<std::pair<std::string, std::array<Reference, 5>>> references = {
      {"small",
       {{{3, 5, -0.375569, 2.345477},
         {64, 68, -0.386140, 2.279933},
         {100, 20, -0.391707, 2.309453},
         {40, 130, -0.273035, 2.369040},
         {127, 135, -0.259499, 2.255127}}}},
      {"large",
       {{{3, 5, -0.137576, 1.039710},
         {64, 68, -0.385564, 2.444123},
         {100, 20, -0.394434, 2.448078},
         {40, 130, -0.233581, 1.538562},
         {127, 135, -0.163613, 1.088418}}}}};
  const torch::NoGradGuard no_grad;
  for (const auto& [network, expected] : references) {
    const torch::Tensor flow =
        MadeUpRaft(network)->forward(testing::MadeUpRaftImage(0), testing::MadeUpRaftImage(1), 4);
    REQUIRE(flow.sizes() == torch::IntArrayRef({1, 2, 128, 136}));
    for (const Reference& at : expected) {
      INFO(network << " " << at.row << " " << at.column);
      CHECK(flow[0][0][at.row][at.column].item<double>() == Approx(at.x).margin(2e-4));
      CHECK(flow[0][1][at.row][at.column].item<double>() == Approx(at.y).margin(2e-4));
    }
  }
}

TEST_CASE("RAFT reproduces the published program's flow with the published weights") {
  const auto shared = SharedData();
  if (!shared) {
    WARN("skipped: no shared data beside the checkout");
    return;
  }
  RaftFlowOptions options;
  options.iterations = 20;
  const RaftFlow raft(LoadRaft(*shared / "weights" / "raft-small.pth"), options);
  // Every 32nd pixel of three pairs, made by the authors' program.
  const torch::Tensor expected =
      ReadNpy(std::filesystem::path(EDITNERF_SOURCE_DIR) / "tests" / "tracking" / "raft_small_hand.npy");
  const std::vector<std::pair<const char*, const char*>> pairs = {{"image000031.png", "image000032.png"},
                                                                  {"image000032.png", "image000031.png"},
                                                                  {"image000001.png", "image000011.png"}};
  for (size_t i = 0; i < pairs.size(); ++i) {
    const auto image = [&](const char* name) { return ReadImage(*shared / "data" / "hand" / "images" / name); };
    const torch::Tensor flow = raft.Flow(image(pairs[i].first), image(pairs[i].second));
    const torch::Tensor sample = flow.slice(0, 0, flow.size(0), 32).slice(1, 0, flow.size(1), 32);
    const torch::Tensor error = (sample - expected[static_cast<int64_t>(i)]).abs();
    const bool neighbours = i < 2;
    // Ten frames apart, single pixels of an unstable flow follow the rounding of the matrix products: 9e-4 with one
    // version of LibTorch, 1.1e-3 with another, 3.1e-3 with the vectors of AVX2.
    CHECK(error.max().item<double>() < (neighbours ? 1e-3 : 1e-2));
    CHECK(error.mean().item<double>() < (neighbours ? 2e-5 : 2e-4));
  }
}

TEST_CASE("names of torchvision and of the authors become one") {
  CHECK(RaftParameterName("module.fnet.layer2.0.downsample.0.bias") == "fnet.layer2.0.downsample.0.bias");
  CHECK(RaftParameterName("context_encoder.layer2.0.convnormrelu2.1.running_var") == "cnet.layer2.0.norm2.running_var");
  CHECK(RaftParameterName("feature_encoder.conv.weight") == "fnet.conv2.weight");
  CHECK(RaftParameterName("feature_encoder.convnormrelu.0.weight") == "fnet.conv1.weight");
  CHECK(RaftParameterName("module.update_block.gru.convz.weight") == "update_block.gru.convz1.weight");
  CHECK(RaftParameterName("module.update_block.gru.convq2.weight") == "update_block.gru.convq2.weight");
  CHECK(RaftParameterName("update_block.recurrent_block.convgru2.convr.bias") == "update_block.gru.convr2.bias");
  CHECK(RaftParameterName("update_block.motion_encoder.convflow2.0.bias") == "update_block.encoder.convf2.bias");
  CHECK(RaftParameterName("mask_predictor.conv.weight") == "update_block.mask.2.weight");
}

TEST_CASE("the zip layout of torch.save gives the same network as safetensors") {
  const ScratchFolder folder;
  const Tensors tensors = testing::MadeUpRaftWeights("large");
  WriteText(folder / "raft.pth", ZipFile(tensors));
  const Raft zip = LoadRaft(folder / "raft.pth"), safe = MadeUpRaft("large");
  const auto a = zip->named_parameters(), b = safe->named_parameters();
  REQUIRE(a.size() == b.size());
  for (const auto& parameter : a) CHECK(torch::equal(parameter.value(), b[parameter.key()]));
}

TEST_CASE("the authors' large network is read from the legacy layout, with its norms that have two names") {
  const Raft expected = MadeUpRaft("large");
  Tensors published;
  for (const auto& list : {expected->named_parameters(), expected->named_buffers()}) {
    for (const auto& entry : list) {
      published["module." + entry.key()] = entry.value();
      const size_t twice = entry.key().find("downsample.1.");
      if (twice == std::string::npos) continue;
      published["module." + entry.key().substr(0, twice) + "norm3." + entry.key().substr(twice + 13)] = entry.value();
    }
  }
  const ScratchFolder folder;
  WriteText(folder / "raft-things.pth", LegacyFile(published));
  const Raft read = LoadRaft(folder / "raft-things.pth");
  const auto a = read->named_parameters(), b = expected->named_parameters();
  for (const auto& parameter : a) CHECK(torch::equal(parameter.value(), b[parameter.key()]));
  const auto means = read->named_buffers(), expected_means = expected->named_buffers();
  CHECK(torch::equal(means["cnet.layer2.0.downsample.1.running_var"],
                     expected_means["cnet.layer2.0.downsample.1.running_var"]));
}

TEST_CASE("files that are not RAFT's weights are refused with their names and what is wrong") {
  Tensors tensors = testing::MadeUpRaftWeights("small");
  CHECK(MessageFor(tensors).empty());
  Tensors changed = tensors;
  changed.erase("update_block.flow_head.conv2.bias");
  CHECK(MessageFor(changed) ==
        "raft.safetensors: no tensor 'update_block.flow_head.conv2.bias': not the weights of RAFT");
  changed = tensors;
  changed["feature_encoder.conv.bias"] = torch::zeros({127});
  CHECK(MessageFor(changed) == "raft.safetensors: tensor 'fnet.conv2.bias' has shape [127], expected [128]");
  changed = tensors;
  changed["feature_encoder.conv.bias"] = torch::full({128}, std::numeric_limits<float>::quiet_NaN());
  CHECK(MessageFor(changed) == "raft.safetensors: tensor 'fnet.conv2.bias' holds values that are not finite");
  changed = tensors;
  changed["mask_predictor.conv.bias"] = torch::zeros({576});
  CHECK(MessageFor(changed) ==
        "raft.safetensors: tensor 'update_block.mask.2.bias' has no place in the small network of RAFT");
  CHECK(MessageFor({{"w", torch::zeros({3})}}) ==
        "raft.safetensors: no tensor 'fnet.conv1.weight': not the weights of RAFT");

  const ScratchFolder folder;
  const std::string whole = ZipFile(tensors);
  WriteText(folder / "short.pth", whole.substr(0, whole.size() / 2));
  CHECK_THROWS_AS(LoadRaft(folder / "short.pth"), DataError);
  WriteText(folder / "short.safetensors", "12345678{");
  CHECK_THROWS_AS(LoadRaft(folder / "short.safetensors"), DataError);
  CHECK_THROWS_AS(LoadRaft(folder / "none.pth"), DataError);
}

TEST_CASE("the correlation's look-up is bilinear, zero outside, and counts columns first") {
  torch::manual_seed(1);
  const torch::Tensor from = torch::randn({2, 16, 9, 12}), to = torch::randn({2, 16, 9, 12});
  constexpr int64_t kRadius = 3, kSide = 2 * kRadius + 1;
  const RaftCorrelation correlation(from, to, kRadius);
  const torch::Tensor places = torch::rand({2, 2, 9, 12}) * 16 - 2;  // some outside
  const torch::Tensor samples = correlation.Lookup(places);
  REQUIRE(samples.sizes() == torch::IntArrayRef({2, RaftCorrelation::kLevels * kSide * kSide, 9, 12}));
  for (const int64_t level : {0, 1}) {
    for (const auto& [dx, dy] : std::vector<std::pair<int64_t, int64_t>>{{0, 0}, {-3, 2}, {1, -2}}) {
      const torch::Tensor target = level == 0 ? to : torch::avg_pool2d(to, 2);
      const torch::Tensor scaled = places / static_cast<double>(int64_t{1} << level);
      const torch::Tensor x = scaled.select(1, 0) + dx, y = scaled.select(1, 1) + dy;
      // torchvision's and the authors' way: the features of `to` sampled there. Linear, so the order does not matter.
      const torch::Tensor grid = torch::stack(
          {2 * x / static_cast<double>(target.size(3) - 1) - 1, 2 * y / static_cast<double>(target.size(2) - 1) - 1},
          3);
      const torch::Tensor expected = (from * torch::grid_sampler_2d(target, grid, 0, 0, true)).sum(1) / 4.0;
      const int64_t channel = level * kSide * kSide + (dx + kRadius) * kSide + dy + kRadius;
      CHECK((samples.select(1, channel) - expected).abs().max().item<double>() < 1e-4);
    }
  }
  // The map of 9 x 12 places ends after three halvings.
  CHECK(samples.slice(1, 3 * kSide * kSide).abs().max().item<double>() > 0);
  const RaftCorrelation small(from.slice(2, 0, 3), to.slice(2, 0, 3), kRadius);
  CHECK((small.Lookup(places.slice(2, 0, 3)).slice(1, 2 * kSide * kSide) == 0).all().item<bool>());
  const torch::Tensor lost = torch::full({2, 2, 9, 12}, std::numeric_limits<float>::quiet_NaN());
  CHECK_NOTHROW(correlation.Lookup(lost));
  CHECK((correlation.Lookup(torch::full({2, 2, 9, 12}, 1e30F)) == 0).all().item<bool>());
}

TEST_CASE("pairs in a batch have the flow that each has alone") {
  const torch::NoGradGuard no_grad;
  const Raft raft = MadeUpRaft("small");
  const torch::Tensor a = testing::MadeUpRaftImage(0), b = testing::MadeUpRaftImage(1), c = testing::MadeUpRaftImage(2);
  const torch::Tensor both = Raft(raft)->forward(torch::cat({a, c}), torch::cat({b, a}), 3);
  CHECK((both[0] - Raft(raft)->forward(a, b, 3)[0]).abs().max().item<double>() < 1e-4);
  CHECK((both[1] - Raft(raft)->forward(c, a, 3)[0]).abs().max().item<double>() < 1e-4);
}

TEST_CASE("RAFT takes images of any size, enlarged or not, and refuses what it cannot take") {
  RaftFlowOptions options;
  options.iterations = 2;
  const Raft network = MadeUpRaft("small");
  const torch::Tensor image = NoiseImage(37, 61);
  for (const int64_t enlarge : {1, 2, 3}) {
    options.enlarge = enlarge;
    const torch::Tensor flow = RaftFlow(network, options).Flow(image, image);
    REQUIRE(flow.sizes() == torch::IntArrayRef({37, 61, 2}));
    CHECK(flow.isfinite().all().item<bool>());
  }
  const RaftFlow raft(network, options);
  CHECK_THROWS_AS(raft.Flow(image, NoiseImage(37, 60)), ShapeError);
  CHECK_THROWS_AS(raft.Flow(image.to(torch::kFloat32), image.to(torch::kFloat32)), ShapeError);
  CHECK_THROWS_AS(raft.Flow(NoiseImage(8, 64), NoiseImage(8, 64)), DataError);
  CHECK_THROWS_AS(raft.FlowFrom(image, image, torch::zeros({37, 60, 2})), ShapeError);
  options.iterations = 0;
  CHECK_THROWS_AS(RaftFlow(network, options), ConfigError);
}

TEST_CASE("RAFT with the published weights measures shifts, and large ones from a guess") {
  const auto shared = SharedData();
  if (!shared) {
    WARN("skipped: no shared data beside the checkout");
    return;
  }
  const torch::Tensor wide = NoiseImage(128, 260);
  const auto view = [&](int64_t left) { return wide.slice(1, left, left + 160).contiguous(); };
  RaftFlowOptions options;
  const Raft network = LoadRaft(*shared / "weights" / "raft-small.pth");
  const auto error = [](const torch::Tensor& flow, double x, int64_t margin) {
    const torch::Tensor inner = flow.slice(0, 16, 112).slice(1, margin, 160 - margin);
    return (inner - torch::tensor({x, 0.0})).norm(2, 2).median().item<double>();
  };
  for (const int64_t enlarge : {1, 2}) {
    options.enlarge = enlarge;
    const RaftFlow raft(network, options);
    CHECK(error(raft.Flow(view(20), view(25)), -5, 16) < (enlarge == 1 ? 0.5 : 0.3));
    torch::Tensor guess = torch::zeros({128, 160, 2});
    guess.select(2, 0).fill_(-58);
    options.iterations = 2;
    const RaftFlow hasty(network, options);
    CHECK(error(hasty.FlowFrom(view(20), view(80), guess), -60, 64) < 1);
    CHECK(error(hasty.Flow(view(20), view(80)), -60, 64) > 3);
    options.iterations = 12;
  }
}
