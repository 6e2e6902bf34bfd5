// The training loop of both stages: random rays, losses, Adam, measurements and checkpoints.
#pragma once

#include <filesystem>
#include <functional>
#include <optional>

#include "libeditnerf/training/adam.h"
#include "libeditnerf/training/held_out.h"
#include "libeditnerf/training/key_point_supervision.h"
#include "libeditnerf/training/metrics_log.h"
#include "libeditnerf/training/recovery.h"
#include "libeditnerf/training/run.h"
#include "libeditnerf/training/step_guard.h"
#include "libeditnerf/training/step_input.h"
#include "libeditnerf/training/step_losses.h"
#include "libeditnerf/training/training_rays.h"
#include "libeditnerf/training/weight_average.h"

namespace editnerf {

class Trainer {
 public:
  // `run` is fresh or loaded; the scene must have its images. `supervision` is for FieldStage::kTrain, where it may be
  // absent too: key points are then moved by the reconstruction alone.
  Trainer(Run run, const Scene& scene, std::optional<KeyPointSupervision> supervision, std::filesystem::path folder);

  // Distances to hold the field to (lambda_depth). Before the first step.
  void SetDepthTargets(const DepthTargets& targets) { rays_.SetDepthTargets(targets); }

  // Places that stand still (still_share) or that a key point carries (carried_share), to be seen in states that no
  // frame has: those in changing light too, where the field sees shade by itself. Of no use without key points; parts
  // that turn are not carried. Before the first step.
  void SetKnownPlaces(const DepthTargets& places);

  // Takes over the optimiser and generator state of a loaded run.
  void Resume(const SavedState& extra);

  // Trains until the configured steps or seconds are over, then saves. Throws Interrupted after Ctrl-C, once the
  // checkpoint is written, and Error where steps go on being not finite after going back to the last good state.
  void Train();

  // One optimisation step: draws rays, and returns the loss terms by name.
  std::map<std::string, double> Step();

  // A step again, from what it had drawn: nothing is drawn and no weight changes.
  StepVerdict Replay(const StepInput& input);

  // With the weights of the last step or, from Train or ShowAverage on until the next step, their mean.
  const Run& run() const { return run_; }

  // The weights' mean over the last steps in their place, where the stage has average_weights.
  void ShowAverage() { average_.Show(); }

 private:
  int64_t RaysForStep() const;
  FrameStates AllStates() const;
  // Key points drawn anew for the batch's last rays, [drawn, N, 3], and those rays carried along with them.
  torch::Tensor DrawStates(RayTargets* batch);
  // The frames' states, and behind them those of the batch's last rays under `drawn` key points.
  FrameStates StatesOf(const RayTargets& batch, const torch::Tensor& drawn) const;
  StepInput Draw();
  StepLosses Backward(const StepInput& input);
  // The same in one fused pass, where renderer and field have one.
  std::optional<StepLosses> FusedBackward(const RayTargets& batch, const RayBatch& rays, const FrameStates& states,
                                          const RayOptions& options);
  void TakeStep();
  // The last good state in the place of what is not finite; its mean begins anew.
  template <class Restore>
  void Recover(const Restore& restore);
  void Count(int64_t rays, int64_t samples);
  void AddKeyPointLosses(const torch::Tensor& key_points, NamedTensors* losses) const;
  double Progress() const;  // in [0, 1], of steps or seconds
  std::optional<double> Measure();
  void Log(const std::map<std::string, double>& losses, std::optional<double> psnr);
  StepVerdict Check(const NamedTensors& losses);
  void Dump(const StepInput& input);
  void Save();

  Run run_;
  StageConfig stage_;
  std::optional<KeyPointSupervision> supervision_;
  std::filesystem::path folder_;
  TrainingRays rays_;
  torch::Tensor part_reach_;  // ClearPlaces::reach
  HeldOut held_out_;
  Adam adam_;
  WeightAverage average_;
  StepGuard guard_;
  Recovery recovery_;
  std::optional<MetricsLog> log_;
  double samples_per_ray_ = 0;  // of the last step
  std::optional<int64_t> resumed_step_;
  int64_t dumped_ = 0;
};

}  // namespace editnerf
