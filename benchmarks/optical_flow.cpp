// End-point errors of optical flow against a synthetic scene's true one, and seconds per pair: dense inverse search and
// RAFT, on images as they are and enlarged.
//
//   bench-optical-flow SCENE WEIGHTS [EVERY] [THREADS] [ITERATIONS]     every EVERY-th pair of neighbouring frames
#include <cstdio>
#include <cstdlib>
#include <functional>
#include <string>
#include <vector>

#include "libeditnerf/base/clock.h"
#include "libeditnerf/base/parallel.h"
#include "libeditnerf/evaluation/flow_error.h"
#include "libeditnerf/imaging/scene_folder.h"
#include "libeditnerf/tracking/flow_sequence.h"
#include "libeditnerf/tracking/raft/weights.h"
#include "libeditnerf/tracking/raft_flow.h"

using namespace editnerf;

namespace {

using Way = std::function<torch::Tensor(const torch::Tensor&, const torch::Tensor&)>;

torch::Tensor Enlarged(const torch::Tensor& image, int64_t factor) {
  return torch::upsample_bicubic2d(image.permute({2, 0, 1}).unsqueeze(0).to(torch::kFloat32).contiguous(),
                                   {factor * image.size(0), factor * image.size(1)}, false)[0]
      .round()
      .clamp(0, 255)
      .to(torch::kUInt8)
      .permute({1, 2, 0})
      .contiguous();
}

torch::Tensor Reduced(const torch::Tensor& flow, int64_t factor) {
  return (torch::avg_pool2d(flow.permute({2, 0, 1}).unsqueeze(0).contiguous(), factor) / factor)[0]
      .permute({1, 2, 0})
      .contiguous();
}

double Median(std::vector<double> values) {
  std::sort(values.begin(), values.end());
  return values[values.size() / 2];
}

void Measure(const char* name, const Way& way, const Scene& scene, int64_t every) {
  FlowErrors errors;
  std::vector<double> seconds;
  double agreeing = 0;
  for (size_t i = 0; i + 1 < scene.train.size(); i += static_cast<size_t>(every)) {
    const int64_t from = scene.train[i], to = scene.train[i + 1];
    const Stopwatch clock;
    const torch::Tensor flow = way(scene.images[from], scene.images[to]);
    seconds.push_back(clock.Seconds());
    errors.Add(flow, scene, from, to);
    if (i == 0 || seconds.size() % 8 == 0) {
      const torch::Tensor back = way(scene.images[to], scene.images[from]);
      agreeing = ForwardBackwardValid(flow, back).to(torch::kFloat32).mean().item<double>();
    }
  }
  std::printf("| %s |", name);
  for (const FlowError& error : errors.Summary()) std::printf(" %.3f / %.3f |", error.median, error.percentile90);
  std::printf(" %.0f %% | %.3f |\n", 100 * agreeing, Median(seconds));
  std::fflush(stdout);
}

}  // namespace

int main(int argc, char** argv) {
  if (argc < 3) {
    std::fprintf(stderr, "usage: bench-optical-flow SCENE WEIGHTS [EVERY] [THREADS] [ITERATIONS]\n");
    return 2;
  }
  const torch::NoGradGuard no_grad;
  const int64_t every = argc > 3 ? std::atoll(argv[3]) : 4;
  SetNumThreads(argc > 4 ? std::atoll(argv[4]) : 2);
  RaftFlowOptions options;
  if (argc > 5) options.iterations = std::atoll(argv[5]);
  const Scene scene = ReadSceneFolder(argv[1], DataConfig());
  const DisFlow dis;
  std::printf("%s, %lld x %lld\n| flow | static | static near an edge | moving | moving near an edge | agree | s |\n",
              argv[1], static_cast<long long>(scene.width()), static_cast<long long>(scene.height()));
  Measure(
      "DIS", [&](const auto& a, const auto& b) { return dis.Flow(a, b); }, scene, every);
  Measure(
      "DIS, 2x", [&](const auto& a, const auto& b) { return Reduced(dis.Flow(Enlarged(a, 2), Enlarged(b, 2)), 2); },
      scene, every);
  const Raft network = LoadRaft(argv[2]);
  for (const int64_t enlarge : {1, 2, 3}) {
    options.enlarge = enlarge;
    const RaftFlow raft(network, options);
    Measure(("RAFT, " + std::to_string(enlarge) + "x").c_str(),
            [&](const auto& a, const auto& b) { return raft.Flow(a, b); }, scene, every);
  }
  return 0;
}
