// From the samples of a ray bundle to what its rays show, and back: colours, compositing and, for training, the
// gradients of the loss, ray by ray.
#pragma once

#include <cstdint>
#include <memory>
#include <vector>

#include "libeditnerf/kernels/packed_tiles.h"
#include "libeditnerf/kernels/ray_bundle.h"

namespace editnerf {

// The loss of R rays, each ray's part of it:
//   emphasis |rgb - target|^2 / (3 R) + distortion D / R + ambient |a at the surface|^2 / R
//   + depth sum_i w_i max(0, |t_i - d| / d - tolerance) / R
// with D as PackedDistortion has it, no third term for a ray without surface, and no last one where d is not known.
struct RayLoss {
  const float* target = nullptr;      // [R, 3]
  const float* emphasis = nullptr;    // [R]; nullptr: all 1
  const float* background = nullptr;  // [R, 3]; nullptr: black
  double distortion = 0;              // weight, per unit of t
  double ambient = 0;                 // weight
  const float* distance = nullptr;    // [R], d, NaN where unknown; nullptr: nowhere known
  const float* tolerance = nullptr;   // [R], given with it
  double depth = 0;                   // weight
  // Russian roulette (Arvo, Kirk 1990): a sample whose gradients with respect to its density's logarithm and its
  // colour before the sigmoid sum up to g / R, less than this by R, goes back through the networks with a chance of
  // g / roulette alone, and then with R / g roulette as much. What comes of it is right on the mean. 0: all go.
  double roulette = 0;
  float* missed = nullptr;  // [R], to be filled with |rgb - target|^2 / 3; nullptr: unwanted
};

struct RayLossSums {
  double reconstruction = 0, distortion = 0, ambient = 0, depth = 0;  // without the division by R
  int64_t samples = 0, returned = 0;                                  // returned: that went back through the networks
  void Add(const RayLossSums& other);
};

// What the rays of a picture show, [R] each.
struct RayPicture {
  float* rgb = nullptr;                        // [R, 3]; nullptr: depth alone
  const float* background = nullptr;           // [R, 3]; nullptr: black
  float *opacity = nullptr, *depth = nullptr;  // depth NaN where there is no surface
  bool* depth_valid = nullptr;
  float *x = nullptr, *ambient = nullptr,
        *weights = nullptr;  // at the surface, [R, 3], [R, A], [R, N]; nullptr: unwanted
  // [R], distance at which a ray first loses kFrontShare of its light, infinite where it does nowhere, and negative
  // where it does so at the first sample that BundledRays::start let it look at: more may lie before. nullptr:
  // unwanted.
  float* front = nullptr;
  // Of a ray's light at most this share takes its colour from the rest of that light, not from the field.
  double color_error = 0;
};

constexpr double kFrontShare = 1.0 / 512;

// Works on the bundles of one thread; keeps the arrays that are needed on the way.
class RayShading {
 public:
  // Colours, losses and their gradients with respect to colour and density, left in the bundle's tiles, with the row
  // `chosen` of those that go back.
  void Train(const FieldKernel& field, const BundledRays& rays, const RayLoss& loss, RayBundle& bundle,
             RayLossSums* sums);

  // The picture of the bundle's rays. Returns the samples whose colour was evaluated.
  int64_t Show(const FieldKernel& field, const BundledRays& rays, const RayPicture& picture, RayBundle& bundle);

 private:
  struct Samples {  // of one ray
    int64_t begin, end;
  };
  void FindHarmonics(const FieldKernel& field, const BundledRays& rays, const RayBundle& bundle);
  void ColorTile(const FieldKernel& field, const BundledRays& rays, const RayBundle& bundle, int64_t count,
                 bool for_gradients, TileMemory& tile, int32_t* state) const;
  void Color(const FieldKernel& field, const BundledRays& rays, RayBundle& bundle);
  int64_t ColorSeen(const FieldKernel& field, const BundledRays& rays, double color_error, RayBundle& bundle);
  int64_t ChooseSeen(double color_error, RayBundle& bundle);
  void Composite(const FieldRows& rows, const BundledRays& rays, RayBundle& bundle);
  void GatherColors(const FieldRows& rows, RayBundle& bundle);
  float FrontOf(const BundledRays& rays, int64_t ray, Samples samples) const;
  int64_t SurfaceOf(Samples samples) const;  // samples.end where there is none
  double Distort(Samples samples, double factor);
  double MissDepth(Samples samples, double distance, double tolerance, double factor);
  int64_t Choose(Samples samples, double least, float jitter);
  void Resize(int64_t samples);

  std::vector<float> t_, density_, tau_, before_, light_, weight_, rgb_[3], to_weight_, to_density_, pull_, chosen_;
  std::vector<float> shown_;           // weights, 0 where the colour was not evaluated
  std::vector<float> harmonics_;       // [rays, 16]
  std::unique_ptr<PackedTiles> seen_;  // the samples that are coloured
  std::vector<int32_t> seen_samples_;  // where the columns of seen_ come from
  std::vector<int64_t> surfaces_;      // of the rays that have one
  double delta_ = 0;
};

}  // namespace editnerf
