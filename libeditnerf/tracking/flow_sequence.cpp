#include "libeditnerf/tracking/flow_sequence.h"

#include <algorithm>
#include <cmath>
#include <memory>
#include <mutex>
#include <vector>

#include "libeditnerf/base/error.h"
#include "libeditnerf/base/interrupt.h"
#include "libeditnerf/base/parallel.h"
#include "libeditnerf/base/progress.h"
#include "libeditnerf/base/shape.h"
#include "libeditnerf/tracking/map_lookup.h"

namespace editnerf {
namespace {

constexpr int64_t kPairsPerBlock = 16;

}  // namespace

torch::Tensor ForwardBackwardValid(const torch::Tensor& flow, const torch::Tensor& opposite) {
  CheckShape(flow, {kAny, kAny, 2}, "flow");
  CheckShape(opposite, {flow.size(0), flow.size(1), 2}, "opposite flow");
  const torch::Tensor from = flow.contiguous(), back = opposite.contiguous();
  const int64_t height = flow.size(0), width = flow.size(1);
  torch::Tensor valid = torch::zeros({height, width}, torch::kBool);
  const float* f = from.data_ptr<float>();
  bool* out = valid.data_ptr<bool>();
  for (int64_t row = 0; row < height; ++row) {
    for (int64_t column = 0; column < width; ++column) {
      const int64_t index = row * width + column;
      const double du = f[2 * index], dv = f[2 * index + 1];
      const Pixel target = {static_cast<double>(column) + 0.5 + du, static_cast<double>(row) + 0.5 + dv};
      const FlowSample b = SampleFlow(back, {}, target);
      if (!b.valid) continue;
      const double eu = du + b.du, ev = dv + b.dv;
      const double size = du * du + dv * dv + b.du * b.du + b.dv * b.dv;
      out[index] = eu * eu + ev * ev <= 0.01 * size + 0.5;
    }
  }
  return valid;
}

void Validate(FlowSequence* sequence) {
  const torch::Tensor &forward = sequence->forward, &backward = sequence->backward;
  CheckShape(forward, {kAny, kAny, kAny, 2}, "forward flow");
  CheckShape(backward, {forward.size(0), forward.size(1), forward.size(2), 2}, "backward flow");
  sequence->forward_valid = torch::empty({forward.size(0), forward.size(1), forward.size(2)}, torch::kBool);
  sequence->backward_valid = torch::empty_like(sequence->forward_valid);
  ParallelParts(forward.size(0), [&](int64_t i) {
    sequence->forward_valid[i].copy_(ForwardBackwardValid(forward[i], backward[i]));
    sequence->backward_valid[i].copy_(ForwardBackwardValid(backward[i], forward[i]));
  });
}

FlowSequence ComputeFlowSequence(const torch::Tensor& images, const OpticalFlow& flow, const FlowGuess& guess) {
  CheckShape(images, {kAny, kAny, kAny, 3}, "images");
  const int64_t pairs = images.size(0) - 1, height = images.size(1), width = images.size(2);
  if (pairs < 1) Throw<DataError>("optical flow: expected at least two training frames, found {}", images.size(0));
  FlowSequence sequence;
  sequence.forward = torch::empty({pairs, height, width, 2}, torch::kFloat32);
  sequence.backward = torch::empty({pairs, height, width, 2}, torch::kFloat32);
  Progress progress("optical flow", static_cast<double>(pairs));
  std::mutex mutex;
  int64_t done = 0;
  // Block by block, because what is prepared of an image can be much larger than the image.
  std::vector<std::shared_ptr<const OpticalFlow::Prepared>> prepared(static_cast<size_t>(images.size(0)));
  const auto between = [&](int64_t from, int64_t to) {
    return flow.FlowBetween(*prepared[static_cast<size_t>(from)], *prepared[static_cast<size_t>(to)],
                            guess ? guess(from, to) : torch::Tensor());
  };
  for (int64_t begin = 0; begin < pairs; begin += kPairsPerBlock) {
    const int64_t count = std::min(kPairsPerBlock, pairs - begin);
    ParallelParts(count + 1, [&](int64_t k) {
      auto& slot = prepared[static_cast<size_t>(begin + k)];
      if (!slot) slot = flow.Prepare(images[begin + k]);
    });
    ParallelParts(count, [&](int64_t k) {
      if (InterruptRequested()) Throw<Interrupted>("interrupted during optical flow");
      const int64_t i = begin + k;
      sequence.forward[i].copy_(between(i, i + 1));
      sequence.backward[i].copy_(between(i + 1, i));
      const std::lock_guard<std::mutex> lock(mutex);
      progress.Update(static_cast<double>(++done));
    });
    for (int64_t k = 0; k < count; ++k) prepared[static_cast<size_t>(begin + k)].reset();
  }
  progress.Finish();
  Validate(&sequence);
  return sequence;
}

}  // namespace editnerf
