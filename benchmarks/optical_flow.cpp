// End-point errors of optical flow against a synthetic scene's true one, and processor seconds per pair: dense inverse
// search and RAFT, on images as they are and enlarged, one from the other, and from the flow of the still scene.
//
//   bench-optical-flow SCENE WEIGHTS [EVERY] [GAP] [THREADS] [ITERATIONS]
// takes every EVERY-th (4) pair of training frames that are GAP (1) apart.
#include <sys/resource.h>

#include <algorithm>
#include <cstdio>
#include <cstdlib>
#include <functional>
#include <string>
#include <vector>

#include "libeditnerf/base/parallel.h"
#include "libeditnerf/evaluation/flow_error.h"
#include "libeditnerf/imaging/scene_folder.h"
#include "libeditnerf/tracking/raft/weights.h"
#include "libeditnerf/tracking/raft_flow.h"
#include "libeditnerf/tracking/still_flow.h"

using namespace editnerf;

namespace {

struct Pair {
  int64_t from, to;  // frames of the scene
};
using Way = std::function<torch::Tensor(const torch::Tensor&, const torch::Tensor&, const Pair&)>;

double ProcessorSeconds() {
  rusage usage;
  getrusage(RUSAGE_SELF, &usage);
  return static_cast<double>(usage.ru_utime.tv_sec + usage.ru_stime.tv_sec) +
         1e-6 * static_cast<double>(usage.ru_utime.tv_usec + usage.ru_stime.tv_usec);
}

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

class Bench {
 public:
  Bench(const Scene& scene, int64_t every, int64_t gap) : scene_(scene) {
    const auto count = static_cast<int64_t>(scene.train.size());
    for (int64_t i = 0; i + gap < count; i += every) {
      pairs_.push_back({scene.train[static_cast<size_t>(i)], scene.train[static_cast<size_t>(i + gap)]});
    }
  }

  void Measure(const std::string& name, const Way& way) const {
    FlowErrors errors;
    std::vector<double> seconds;
    for (const Pair& pair : pairs_) {
      const double before = ProcessorSeconds();
      const torch::Tensor flow = way(scene_.images[pair.from], scene_.images[pair.to], pair);
      seconds.push_back(ProcessorSeconds() - before);
      errors.Add(flow, scene_, pair.from, pair.to);
    }
    std::printf("| %s |", name.c_str());
    for (const FlowError& error : errors.Summary()) std::printf(" %.3f / %.3f |", error.median, error.percentile90);
    std::printf(" %.3f |\n", Median(seconds));
    std::fflush(stdout);
  }

 private:
  const Scene& scene_;
  std::vector<Pair> pairs_;
};

}  // namespace

int main(int argc, char** argv) {
  if (argc < 3) {
    std::fprintf(stderr, "usage: bench-optical-flow SCENE WEIGHTS [EVERY] [GAP] [THREADS] [ITERATIONS]\n");
    return 2;
  }
  const torch::NoGradGuard no_grad;
  const auto argument = [&](int i, int64_t fallback) { return argc > i ? std::atoll(argv[i]) : fallback; };
  SetNumThreads(argument(5, 1));
  const Scene scene = ReadSceneFolder(argv[1], DataConfig());
  const Bench bench(scene, argument(3, 4), argument(4, 1));
  const auto still = [&](const Pair& pair) {
    const auto camera = [&](int64_t frame) { return scene.frames[static_cast<size_t>(frame)].camera; };
    return StillFlow(camera(pair.from), scene.truth->depth[pair.from], camera(pair.to));
  };
  std::printf("%s, %lld x %lld, frames %lld apart\n", argv[1], static_cast<long long>(scene.width()),
              static_cast<long long>(scene.height()), static_cast<long long>(argument(4, 1)));
  std::printf("| flow | static | static near an edge | moving | moving near an edge | processor s |\n");
  const DisFlow dis;
  bench.Measure("DIS", [&](const auto& a, const auto& b, const Pair&) { return dis.Flow(a, b); });
  bench.Measure("DIS, 2x", [&](const auto& a, const auto& b, const Pair&) {
    return Reduced(dis.Flow(Enlarged(a, 2), Enlarged(b, 2)), 2);
  });
  bench.Measure("DIS from still",
                [&](const auto& a, const auto& b, const Pair& pair) { return dis.FlowFrom(a, b, still(pair)); });
  const Raft network = LoadRaft(argv[2]);
  for (const int64_t enlarge : {1, 2, 3}) {
    RaftFlowOptions options;
    options.iterations = argument(6, options.iterations);
    options.enlarge = enlarge;
    const RaftFlow raft(network, options);
    const std::string name = "RAFT, " + std::to_string(enlarge) + "x";
    bench.Measure(name, [&](const auto& a, const auto& b, const Pair&) { return raft.Flow(a, b); });
    bench.Measure(name + ", DIS from it",
                  [&](const auto& a, const auto& b, const Pair&) { return dis.FlowFrom(a, b, raft.Flow(a, b)); });
    if (enlarge != 2) continue;
    bench.Measure(name + " from still, DIS from it", [&](const auto& a, const auto& b, const Pair& pair) {
      return dis.FlowFrom(a, b, raft.FlowFrom(a, b, still(pair)));
    });
  }
  return 0;
}
