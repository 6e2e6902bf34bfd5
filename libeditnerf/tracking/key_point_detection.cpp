#include "libeditnerf/tracking/key_point_detection.h"

#include <fmt/format.h>

#include <algorithm>

#include "libeditnerf/tracking/candidates.h"
#include "libeditnerf/tracking/moving_parts.h"
#include "libeditnerf/tracking/part_candidates.h"
#include "libeditnerf/tracking/volume_candidates.h"

namespace editnerf {
namespace {

size_t At(int64_t i) { return static_cast<size_t>(i); }

void Describe(const Clip& clip, const MovingParts& moving, Detection* detection) {
  for (const MovingPart& part : moving.parts) {
    detection->notes.push_back(fmt::format(
        "a rigid part with {} points, seen at {} pixels in {} of {} frames, goes {:.0f} pixels at 320 wide {}",
        part.body.points.size(), part.body.observations, SeenFrames(part.body).size(), clip.num_frames(), part.range,
        NameOf(part.body.motion)));
  }
}

// After selection: each part's distances, with the key point that it carries.
void CollectPartDepths(const Clip& clip, const MovingParts& moving, const std::vector<const Candidate*>& kept,
                       Detection* detection) {
  for (size_t part = 0; part < moving.parts.size(); ++part) {
    int64_t key_point = kNotCarried;
    for (size_t n = 0; n < kept.size(); ++n)
      if (kept[n]->part == static_cast<int64_t>(part)) key_point = static_cast<int64_t>(n);
    detection->part_depth =
        Joined(detection->part_depth, PartDepths(clip, moving.tracks, moving.parts[part].body, key_point));
  }
}

void Store(const std::vector<const Candidate*>& kept, const Clip& clip, Detection* detection) {
  const auto count = static_cast<int64_t>(kept.size()), frames = clip.num_frames();
  detection->reference = torch::zeros({count, 3}, torch::kFloat32);
  detection->tracks = torch::zeros({frames, count, 3}, torch::kFloat32);
  detection->visible = torch::zeros({frames, count}, torch::kBool);
  detection->score = torch::zeros({count}, torch::kFloat32);
  const auto put = [](float* out, const Vec3& p) {
    out[0] = static_cast<float>(p.x), out[1] = static_cast<float>(p.y), out[2] = static_cast<float>(p.z);
  };
  for (int64_t n = 0; n < count; ++n) {
    const Candidate& candidate = *kept[At(n)];
    detection->rigid.push_back(candidate.part >= 0);
    put(detection->reference.data_ptr<float>() + 3 * n,
        clip.Lift(candidate.start.frame, candidate.start.pixel, candidate.start.distance));
    detection->score[n] = candidate.maximum.value;
    detection->reference_frame.push_back(candidate.start.frame);
    detection->pixel_tracks.push_back(candidate.pixels);
    if (!candidate.turns.empty() && !detection->turns.defined())
      detection->turns = torch::zeros({frames, count, 3}, torch::kFloat32);
    for (int64_t t = 0; t < frames; ++t) {
      put(detection->tracks.data_ptr<float>() + 3 * (t * count + n), candidate.track.position[At(t)]);
      if (!candidate.turns.empty())
        put(detection->turns.data_ptr<float>() + 3 * (t * count + n), candidate.turns[At(t)]);
      detection->visible.data_ptr<bool>()[t * count + n] = candidate.track.visible[At(t)];
    }
  }
}

torch::Tensor CanonicalPoints(const Scene& scene, const PretrainedMaps& maps) {
  if (maps.x_canonical.defined()) return maps.x_canonical;
  // Written in place: a list of all frames' points and their stack would take twice the memory.
  const auto frames = static_cast<int64_t>(scene.train.size());
  torch::Tensor points = torch::empty({frames, scene.height(), scene.width(), 3});
  for (int64_t t = 0; t < frames; ++t) {
    points[t].copy_(SurfacePoints(scene.frames[At(scene.train[At(t)])].camera, maps.depth[t]));
  }
  return points;
}

}  // namespace

Detection DetectKeyPoints(const Scene& scene, const PretrainedMaps& maps, const FlowSequence& flows,
                          const OpticalFlow& flow, const DetectionConfig& config) {
  maps.Check(scene);
  Detection detection;
  SurfaceVolumeOptions options;
  options.resolution = config.volume_resolution;
  options.min_observations = std::min(config.min_observations, static_cast<int64_t>(scene.train.size()));
  options.smoothing = config.smoothing;
  const Clip clip = MakeClip(scene, maps.depth, flows);
  DirectFlows direct(clip, flow);
  const DepthRange range = {scene.transform.near, scene.transform.far};
  detection.motion = MeasureMotion(clip);
  detection.volume = BuildSurfaceVolume(CanonicalPoints(scene, maps), maps.ambient, options,
                                        detection.motion.MovingPixels(scene.height(), scene.width()));
  detection.candidates = LocalMaxima(detection.volume, config.min_distance, config.relative_threshold);

  std::vector<Candidate> candidates;
  MovingParts moving;
  if (config.rigid_parts) {
    moving = FindMovingParts(clip, detection.motion, &direct, range);
    Describe(clip, moving, &detection);
    candidates = PartCandidates(clip, moving);
  }
  // Beside parts the volume's maxima count where more key points are asked for than there are parts.
  if (!config.rigid_parts || static_cast<int64_t>(candidates.size()) < config.count) {
    for (Candidate& candidate : VolumeCandidates(clip, &direct, detection.motion, range, detection.candidates,
                                                 detection.volume.voxel_size, config, &detection.notes)) {
      if (config.rigid_parts && candidate.objection.empty()) candidate.objection = "no rigid part moves there";
      candidates.push_back(std::move(candidate));
    }
  }
  const std::vector<const Candidate*> kept = SelectCandidates(candidates, config, &detection.notes);
  Store(kept, clip, &detection);
  CollectPartDepths(clip, moving, kept, &detection);
  if (kept.empty()) {
    detection.notes.push_back(
        config.rigid_parts
            ? "no rigid part found that moves: the scene looks static"
            : fmt::format("no moving part found among {} candidates: the scene looks static", candidates.size()));
  }
  return detection;
}

}  // namespace editnerf
