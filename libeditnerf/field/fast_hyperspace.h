// The fast field's network over hyperspace: two hash encodings and two small networks.
//
//   f = [ hash(x'), hash(x' - p), gamma(ambient) ]      (x', p) and (x', x' - p) span the same six dimensions, and in
//   (sigma, g) = density network (f)                    x' - p a part that translates with its key point stands still;
//                                                       one that turns as well does in local frames (local_frames.h)
//   c = colour network (g, harmonics(d), alpha_t, s)
//
// With several key points each has a room of its own in the second encoding, as parts that lie at the same x' - p are
// others: the unit cube is divided into rooms^3 of them, rooms^3 >= N, and a sample goes where the weights say.
//
// A part casts shadows on places that other key points govern, where p, as in eq. (3), says nothing of it. In x' - k_i
// the space that part i shades stands still as well, under light from afar, and whatever the other parts do:
//   s = sum_i hash_s(A (x' - k_i)), each key point in its room, fading out as above
// for the colour alone, as a shadow has no density; key points are not moved by it. Along the light a shadow hardly
// changes: where the lamp's direction is known, A turns one axis to it and shortens what lies along it
// (shade_along_light), so that the shadow of a part that is lifted higher than in any frame falls where it should.
// Otherwise A = 1.
//
// Takes the place of H in EditableNeRF, eq. (4). Without key points (pretraining) there is no second hash encoding.
#pragma once

#include <torch/types.h>

#include <memory>
#include <optional>
#include <vector>

#include "libeditnerf/config/field_config.h"
#include "libeditnerf/field/hyperspace_network.h"
#include "libeditnerf/field/mlp.h"
#include "libeditnerf/field/positional_encoding.h"
#include "libeditnerf/geometry/box.h"
#include "libeditnerf/kernels/fused_field.h"

namespace editnerf {

struct FastHyperspaceOptions {
  FastFieldConfig config;
  Box box;                     // of the scene, scene units
  int64_t ambient_dim = 0;     // 0: a static scene
  int64_t num_key_points = 0;  // N; 0: HyperspaceInput::local is not given
  bool use_direction = true;
  int64_t appearance_dim = 0;  // 0: the colour does not depend on the frame
  std::optional<Vec3> lamp;    // towards it, unit length, scene axes
};

class FastHyperspace : public HyperspaceNetwork {
 public:
  explicit FastHyperspace(const FastHyperspaceOptions& options);

  HyperspaceOutput Evaluate(const HyperspaceInput& input) override;
  torch::Tensor Density(const HyperspaceInput& input) override;
  void SetStep(int64_t step) override;

  // Fills in its part: encodings, density and colour.
  void AddTo(FusedField* field) const;

 private:
  torch::Tensor DensityFeatures(const HyperspaceInput& input);  // [S, 1 + geometry_features]
  int64_t AmbientOctaves() const {
    return options_.num_key_points > 0 ? options_.config.key_point_octaves : options_.config.ambient_octaves;
  }
  torch::Tensor LocalFeatures(const HyperspaceInput& input) const;  // [S, L * F]
  bool HasShade() const { return options_.config.shade && options_.num_key_points > 1; }
  torch::Tensor ShadeFeatures(const HyperspaceInput& input) const;  // [S, L * F]
  // The local cube's coordinates of x' - k, in [-0.5, 0.5] inside, and by how much features fade there, [..., 1].
  torch::Tensor InLocalCube(const torch::Tensor& offset, torch::Tensor* fade) const;

  FastHyperspaceOptions options_;
  std::optional<PositionalEncoding> ambient_encoding_;
  double ambient_window_ = 1;         // of pretraining
  std::vector<float> local_windows_;  // [L], coarse to fine; empty: all open
  std::vector<int64_t> canonical_resolutions_, local_resolutions_, shade_resolutions_;
  torch::Tensor canonical_table_, local_table_, shade_table_;  // [L, T, F]
  std::shared_ptr<Bf16Table> canonical_copy_ = std::make_shared<Bf16Table>(),
                             local_copy_ = std::make_shared<Bf16Table>(),
                             shade_copy_ = std::make_shared<Bf16Table>();  // for the kernels
  torch::Tensor box_low_;                                                  // [3] buffer
  torch::Tensor rooms_;                                                    // [N, 3] buffer, corners in rooms
  torch::Tensor shade_axes_;                                               // [3, 3] buffer, A
  Mlp density_network_{nullptr}, color_network_{nullptr};
};

}  // namespace editnerf
