#include <torch/optim.h>
#include <torch/types.h>
#include <torch/utils.h>

#include <memory>

#include "libeditnerf/benchmarks/kernel_cases.h"
#include "libeditnerf/kernels/adam_step.h"
#include "libeditnerf/kernels/fused_mlp.h"
#include "libeditnerf/kernels/hash_encoding.h"
#include "libeditnerf/render/occupancy_grid.h"
#include "libeditnerf/render/ray_marcher.h"

namespace editnerf {
namespace {

constexpr int64_t kStepsPerRay = 32;
constexpr int64_t kMarchSteps = 128;
constexpr double kOccupiedShare = 0.1;
constexpr int64_t kSamplesOfStep = 32768;  // of training

// A call with gradients of everything, and one without.
template <class Forward>
std::function<void()> BothWays(const Forward& forward, const std::vector<torch::Tensor>& leaves) {
  return [forward, leaves] {
    const torch::Tensor out = forward();
    out.backward(torch::ones_like(out));
    for (const torch::Tensor& leaf : leaves) leaf.mutable_grad() = torch::Tensor();
  };
}

template <class Forward>
std::function<void()> WithoutGradients(const Forward& forward) {
  return [forward] {
    const torch::NoGradGuard no_grad;
    forward();
  };
}

torch::Tensor RandomTable(const HashEncodingConfig& hash) {
  return torch::rand({hash.num_levels, int64_t{1} << hash.log2_table_size, hash.features_per_level});
}

void AddEncoding(const Config& config, int64_t samples, std::vector<KernelCase>* cases) {
  const HashEncodingConfig& hash = config.field.fast.canonical_hash;
  const auto resolutions = HashResolutions(hash.num_levels, hash.base_resolution, hash.finest_resolution);
  const auto x = torch::rand({samples, 3});
  const auto table = RandomTable(hash).requires_grad_();
  const auto kernel = [=] { return HashEncode(x, table, resolutions); };
  const auto reference = [=] { return HashEncodeReference(x, table, resolutions); };
  const auto count = static_cast<double>(samples);
  const double operations = EncodingOperations(hash.num_levels);
  cases->push_back({"hash encoding", count, operations, WithoutGradients(kernel), WithoutGradients(reference)});
  cases->push_back(
      {"hash encoding, both ways", count, 2 * operations, BothWays(kernel, {table}), BothWays(reference, {table})});
}

void AddNetwork(const Config& config, int64_t samples, std::vector<KernelCase>* cases) {
  const int64_t width = config.field.fast.width;
  const std::vector<int64_t> widths = {config.field.fast.geometry_features + 16, width, width, 3};
  MlpLayers layers;
  for (size_t l = 0; l + 1 < widths.size(); ++l) {
    layers.weights.push_back((torch::rand({widths[l + 1], widths[l]}) - 0.5).requires_grad_());
    layers.biases.push_back(torch::zeros({widths[l + 1]}).requires_grad_());
  }
  std::vector<torch::Tensor> leaves = layers.weights;
  leaves.insert(leaves.end(), layers.biases.begin(), layers.biases.end());
  const auto input = torch::rand({samples, widths.front()}).requires_grad_();
  leaves.push_back(input);
  const auto kernel = [=] { return FusedMlp({input}, layers); };
  const auto reference = [=] { return MlpReference({input}, layers); };
  const auto count = static_cast<double>(samples);
  const double operations = NetworkOperations(widths);
  cases->push_back({"small network", count, operations, WithoutGradients(kernel), WithoutGradients(reference)});
  cases->push_back(
      {"small network, both ways", count, 3 * operations, BothWays(kernel, leaves), BothWays(reference, leaves)});
}

void AddCompositing(int64_t samples, std::vector<KernelCase>* cases) {
  const int64_t rays = samples / kStepsPerRay;
  PackedSamples packed;
  packed.ray = torch::arange(rays).repeat_interleave(kStepsPerRay);
  packed.t = torch::linspace(0.1, 1, kStepsPerRay).repeat({rays});
  packed.delta = torch::full({rays * kStepsPerRay}, 0.9 / kStepsPerRay);
  packed.offsets = torch::arange(rays + 1) * kStepsPerRay;
  const auto density = (torch::rand({rays * kStepsPerRay}) * 10).requires_grad_();
  const auto radiance = torch::rand({rays * kStepsPerRay, 3}).requires_grad_();
  const auto background = torch::rand({3});
  const auto kernel = [=] { return CompositeSamples(packed, density, radiance, background, false).rgb; };
  const auto reference = [=] { return CompositePadded(packed, density, radiance, background, false).rgb; };
  const auto count = static_cast<double>(rays * kStepsPerRay);
  cases->push_back({"compositing", count, 0, WithoutGradients(kernel), WithoutGradients(reference)});
  cases->push_back({"compositing, both ways", count, 0, BothWays(kernel, {density, radiance}),
                    BothWays(reference, {density, radiance})});
}

void AddMarching(const Config& config, int64_t samples, std::vector<KernelCase>* cases) {
  OccupancyOptions options;
  options.resolution = config.render.occupancy_resolution;
  const auto grid = std::make_shared<OccupancyGrid>(Box{{-1, -1, -1}, {1, 1, 1}}, options);
  const auto buffers = grid->named_buffers();
  const torch::Tensor occupied = buffers["occupied"];
  occupied.copy_(torch::rand(occupied.sizes()) < kOccupiedShare);
  const OccupancyBits bits = {buffers["low"], buffers["high"], occupied, options.resolution};
  const int64_t rays = samples / kStepsPerRay;
  MarchedRays marched;
  marched.origin = torch::rand({rays, 3}) - 0.5;
  const auto toward = torch::rand({rays, 3}) - 0.5;
  marched.direction = toward / toward.norm(2, 1, true);
  marched.jitter = torch::rand({rays});
  const auto kernel = [=] { return MarchRays(marched, 0.05, 1.0, kMarchSteps, bits); };
  const auto reference = [=] {
    const auto near = torch::full({rays}, 0.05F), far = torch::full({rays}, 1.0F);
    const auto t = MarchCandidates(near, far, kMarchSteps, marched.jitter);
    const auto x = marched.origin.unsqueeze(1) + t.unsqueeze(2) * marched.direction.unsqueeze(1);
    return PackSamples(t, torch::full_like(t, 0.95 / kMarchSteps), grid->Occupied(x));
  };
  const auto kept = static_cast<double>(kernel().t.size(0));
  cases->push_back({"marching, a kept sample", kept, 0, WithoutGradients(kernel), WithoutGradients(reference)});
}

// What a step leaves in a table's gradient: light reaches samples near surfaces, here a sphere, so that few of the
// coarse entries are touched and nearly all of the fine ones. Half of all together, as measured in training.
torch::Tensor GradientOfStep(const HashEncodingConfig& hash) {
  const auto toward = torch::randn({kSamplesOfStep, 3});
  const auto x = 0.5 + (0.28 + 0.005 * torch::randn({kSamplesOfStep, 1})) * toward / toward.norm(2, 1, true);
  const auto table = RandomTable(hash).requires_grad_();
  const auto features =
      HashEncode(x, table, HashResolutions(hash.num_levels, hash.base_resolution, hash.finest_resolution));
  features.backward(torch::randn_like(features));
  return table.grad().flatten();
}

// Values and moments of a table, for the kernels and for LibTorch's own.
struct AdamTable {
  torch::Tensor values, first, second, gradient, theirs;
  std::shared_ptr<torch::optim::Adam> optimizer;
  AdamUpdate update = {0.9F, 0.99F, 1e-3F, 1.0F, 1e-15F};

  explicit AdamTable(const torch::Tensor& gradients)
      : values(torch::rand_like(gradients)),
        first(torch::zeros_like(gradients)),
        second(torch::zeros_like(gradients)),
        gradient(gradients.clone()),
        theirs(values.clone().requires_grad_()) {
    theirs.mutable_grad() = gradients.clone();
    const auto options = torch::optim::AdamOptions(update.rate).betas({update.beta1, update.beta2}).eps(update.epsilon);
    optimizer = std::make_shared<torch::optim::Adam>(std::vector<torch::Tensor>{theirs}, options);
  }
  template <class Step>
  void Take(const Step& step) const {
    step(update, gradient.numel(), gradient.data_ptr<float>(), values.data_ptr<float>(), first.data_ptr<float>(),
         second.data_ptr<float>());
  }
};

void AddAdam(const Config& config, std::vector<KernelCase>* cases) {
  const HashEncodingConfig& hash = config.field.fast.canonical_hash;
  const AdamTable dense(torch::randn_like(RandomTable(hash).flatten()));
  cases->push_back({"Adam, a parameter", static_cast<double>(dense.values.numel()), 0, [=] { dense.Take(AdamStep); },
                    [=] { dense.optimizer->step(); }});
  // The sparse step clears its gradient, so that it has to be put there again, for both.
  const auto left = GradientOfStep(hash);
  const AdamTable sparse(left);
  cases->push_back({"sparse Adam, a touched parameter", static_cast<double>(left.count_nonzero().item<int64_t>()), 0,
                    [=] {
                      sparse.gradient.copy_(left);
                      sparse.Take(SparseAdamStep);
                    },
                    [=] {
                      sparse.theirs.grad().copy_(left);
                      sparse.optimizer->step();
                    }});
}

}  // namespace

double EncodingOperations(int64_t levels) {
  // A corner's weight takes two products, each of two features a multiply-add.
  constexpr double kPerLevel = 8 * (2 + 2 * 2);
  return kPerLevel * static_cast<double>(levels);
}

double NetworkOperations(const std::vector<int64_t>& widths) {
  double operations = 0;
  for (size_t l = 0; l + 1 < widths.size(); ++l) operations += 2.0 * static_cast<double>(widths[l] * widths[l + 1]);
  return operations;
}

std::vector<KernelCase> TensorKernelCases(const Config& config, int64_t samples) {
  std::vector<KernelCase> cases;
  AddEncoding(config, samples, &cases);
  AddNetwork(config, samples, &cases);
  AddCompositing(samples, &cases);
  AddMarching(config, samples, &cases);
  AddAdam(config, &cases);
  return cases;
}

}  // namespace editnerf
