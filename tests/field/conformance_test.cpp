// What every module of the field promises: save and load, both precisions, gradients for every parameter, any device.
#include <torch/cuda.h>
#include <torch/nn/module.h>
#include <torch/serialize.h>
#include <torch/types.h>

#include <functional>
#include <memory>
#include <sstream>
#include <string>
#include <vector>

#include "libeditnerf/field/frame_codes.h"
#include "libeditnerf/field/hyperspace_nerf.h"
#include "libeditnerf/field/key_points.h"
#include "libeditnerf/field/mlp.h"
#include "libeditnerf/field/slicing_network.h"
#include "libeditnerf/field/warp_field.h"
#include "libeditnerf/field/weight_network.h"
#include "tests/catch.h"

using namespace editnerf;

namespace {

struct Subject {
  std::string name;
  std::function<std::shared_ptr<torch::nn::Module>()> make;
  std::function<torch::Tensor(torch::nn::Module&, const torch::TensorOptions&)> evaluate;
};

torch::Tensor Input(std::initializer_list<int64_t> shape, const torch::TensorOptions& options) {
  int64_t count = 1;
  for (const int64_t size : shape) count *= size;
  return (torch::arange(count, torch::kFloat64) * 0.7371).remainder(1.0).sub(0.5).reshape(shape).to(options);
}

torch::Tensor Indices(std::initializer_list<int64_t> values, const torch::TensorOptions& options) {
  return torch::tensor(std::vector<int64_t>(values), torch::kInt64).to(options.device());
}

HyperspaceInput HyperspacePoints(const torch::TensorOptions& options) {
  HyperspaceInput input;
  input.x_canonical = Input({7, 3}, options);
  input.ambient = Input({7, 3}, options) * 2;
  const auto direction = Input({7, 3}, options) + 0.6;
  input.direction = direction / direction.norm(2, -1, true);
  input.appearance = Input({7, 4}, options);
  return input;
}

std::vector<Subject> Subjects() {
  MlpOptions mlp;
  mlp.in = 3, mlp.depth = 3, mlp.width = 16, mlp.skip_layer = 2, mlp.out = 2;
  WarpFieldConfig warp;
  warp.head_init = 0.1;
  WeightNetworkConfig weights;
  weights.output_init = 0.5;
  SlicingNetworkConfig slicing;
  slicing.output_init = 0.5;
  HyperspaceNerfConfig nerf;
  nerf.depth = 5, nerf.width = 32;
  return {
      {"Mlp", [=] { return Mlp(mlp).ptr(); },
       [](torch::nn::Module& m, const torch::TensorOptions& o) {
         return m.as<MlpImpl>()->forward(Input({7, 3}, o));
       }},
      {"WarpField", [=] { return WarpField(warp).ptr(); },
       [](torch::nn::Module& m, const torch::TensorOptions& o) {
         return m.as<WarpFieldImpl>()->forward(Input({7, 3}, o), Input({7, 8}, o));
       }},
      {"WeightNetwork", [=] { return WeightNetwork(weights, 5).ptr(); },
       [](torch::nn::Module& m, const torch::TensorOptions& o) {
         return m.as<WeightNetworkImpl>()->forward(Input({7, 3}, o)).square();
       }},
      {"SlicingNetwork", [=] { return SlicingNetwork(slicing, 8).ptr(); },
       [](torch::nn::Module& m, const torch::TensorOptions& o) {
         return m.as<SlicingNetworkImpl>()->forward(Input({7, 3}, o), Input({7, 8}, o));
       }},
      {"FrameCodes", [] { return FrameCodes(5, 4, 0.05).ptr(); },
       [](torch::nn::Module& m, const torch::TensorOptions& o) {
         return m.as<FrameCodesImpl>()->forward(Indices({4, 0, 0}, o));
       }},
      {"KeyPointTable",
       [] {
         return KeyPointTable(torch::rand({5, 2, 3})).ptr();
       },
       [](torch::nn::Module& m, const torch::TensorOptions& o) {
         return m.as<KeyPointTableImpl>()->Positions(Indices({4, 0, 0}, o));
       }},
      {"HyperspaceNerf",
       [=] {
         return HyperspaceNerf(nerf, HyperspaceInputs{3, 5, 4}).ptr();
       },
       [](torch::nn::Module& m, const torch::TensorOptions& o) {
         const HyperspaceOutput output = m.as<HyperspaceNerfImpl>()->Evaluate(HyperspacePoints(o));
         return torch::cat({output.density.unsqueeze(1), output.radiance}, 1);
       }},
  };
}

}  // namespace

TEST_CASE("every field module gives the same values after saving and loading") {
  for (const Subject& subject : Subjects()) {
    INFO(subject.name);
    const auto saved = subject.make(), loaded = subject.make();
    std::stringstream file;
    torch::serialize::OutputArchive out;
    saved->save(out);
    out.save_to(file);
    torch::serialize::InputArchive in;
    in.load_from(file);
    loaded->load(in);
    CHECK(subject.evaluate(*saved, torch::kFloat32).equal(subject.evaluate(*loaded, torch::kFloat32)));
  }
}

TEST_CASE("every field module agrees with itself in single and double precision") {
  for (const Subject& subject : Subjects()) {
    INFO(subject.name);
    const auto module = subject.make();
    const auto single_precision = subject.evaluate(*module, torch::kFloat32);
    CHECK(single_precision.scalar_type() == torch::kFloat32);
    module->to(torch::kFloat64);
    const auto double_precision = subject.evaluate(*module, torch::kFloat64);
    CHECK(double_precision.scalar_type() == torch::kFloat64);
    CHECK((double_precision - single_precision.to(torch::kFloat64)).abs().max().item<double>() < 1e-4);
  }
}

TEST_CASE("every parameter of every field module receives a finite gradient") {
  for (const Subject& subject : Subjects()) {
    for (const auto dtype : {torch::kFloat32, torch::kFloat64}) {
      const auto module = subject.make();
      module->to(dtype);
      subject.evaluate(*module, dtype).sum().backward();
      for (const auto& parameter : module->named_parameters()) {
        INFO(subject.name << " " << parameter.key());
        REQUIRE(parameter.value().grad().defined());
        CHECK(parameter.value().grad().isfinite().all().item<bool>());
      }
    }
  }
}

TEST_CASE("every field module evaluates no samples to no values") {
  HyperspaceNerf network(HyperspaceNerfConfig(), HyperspaceInputs{3, {}, 0});
  HyperspaceInput none;
  none.x_canonical = none.ambient = torch::zeros({0, 3});
  CHECK(network->Evaluate(none).density.sizes() == torch::IntArrayRef({0}));
  CHECK(WarpField(WarpFieldConfig())->forward(torch::zeros({0, 3}), torch::zeros({0, 8})).size(0) == 0);
  CHECK(WeightNetwork(WeightNetworkConfig(), 2)->forward(torch::zeros({0, 3})).size(0) == 0);
}

TEST_CASE("every field module agrees with itself on the CPU and on a GPU") {
  if (!torch::cuda::is_available()) {
    WARN("skipped: no CUDA device");
    return;
  }
  for (const Subject& subject : Subjects()) {
    INFO(subject.name);
    const auto module = subject.make();
    module->to(torch::kFloat64);
    const auto on_host = subject.evaluate(*module, torch::kFloat64);
    module->to(torch::kCUDA);
    const auto on_device = subject.evaluate(*module, torch::dtype(torch::kFloat64).device(torch::kCUDA));
    CHECK((on_device.cpu() - on_host).abs().max().item<double>() < 1e-9);
  }
}
