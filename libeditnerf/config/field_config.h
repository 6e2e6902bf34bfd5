// Sizes of the networks. Defaults are the paper's (EditableNeRF, CVPR 2023, with the numbers of the authors' published
// configuration where the paper is silent); configs/fast.yaml changes what the fast field changes.
#pragma once

#include <cstdint>
#include <string>

#include "libeditnerf/config/fields.h"

namespace editnerf {

// SE(3) warp field x' = T(x, beta_t), eq. (1).
struct WarpFieldConfig {
  Choice enabled = Choice::kOn;  // off while undecided
  int64_t num_octaves = 6;       // of the positional encoding: degrees 0 .. num_octaves-1, plus identity
  int64_t window_steps =
      80000;                // the coarse-to-fine window opens linearly over this many steps; 0: open from the start
  int64_t depth = 6;        // hidden layers
  int64_t width = 128;      // neurons per hidden layer
  int64_t skip_layer = 4;   // the input is concatenated again before this layer; 0: never
  int64_t code_dim = 8;     // dimensions of beta_t
  double head_init = 1e-4;  // both heads start as U(0, head_init)

  template <class Visitor>
  void Visit(Visitor& v) {
    v("enabled", enabled, "build the warp field; exact cameras do not need it, and no kernel fuses it");
    v("num_octaves", num_octaves, "octaves of the positional encoding of x, beside the identity", Between(0, 20));
    v("window_steps", window_steps, "steps over which the coarse-to-fine window opens; 0 opens it at once", AtLeast(0));
    v("depth", depth, "hidden layers of the trunk", Between(1, 32));
    v("width", width, "neurons per hidden layer", Between(1, 4096));
    v("skip_layer", skip_layer, "layer before which the input is concatenated again; 0 for never", Between(0, 32));
    v("code_dim", code_dim, "dimensions of the warp code beta_t", Between(1, 256));
    v("head_init", head_init, "rotation and translation heads start uniform in [0, head_init]", AtLeast(0));
  }
};

// Softmax weight network w = W(x'), eq. (2). Built only for two key points or more.
struct WeightNetworkConfig {
  int64_t num_octaves = 6;
  int64_t depth = 4;
  int64_t width = 32;
  double output_init = 1e-5;  // standard deviation of the output layer: training starts at equal weights
  double distance_prior = 0;  // on the distances from the key points' initial tracks; 0: none, as in the paper

  template <class Visitor>
  void Visit(Visitor& v) {
    v("num_octaves", num_octaves, "octaves of the positional encoding of x', beside the identity", Between(0, 20));
    v("depth", depth, "hidden layers", Between(1, 32));
    v("width", width, "neurons per hidden layer", Between(1, 4096));
    v("output_init", output_init, "standard deviation of the output layer's initial weights", AtLeast(0));
    v("distance_prior", distance_prior,
      "by how much logits start lower one track spacing away from a key point's initial track; 0 for equal weights",
      Between(0, 100));
  }
};

// Slicing network a = S(x, beta_t) of the pretrained HyperNeRF.
struct SlicingNetworkConfig {
  int64_t ambient_dim = 3;  // 0: undecided
  int64_t num_octaves = 6;
  int64_t depth = 6;
  int64_t width = 64;
  int64_t skip_layer = 4;
  double output_init = 1e-5;

  int64_t AmbientDim() const { return ambient_dim > 0 ? ambient_dim : 3; }  // while undecided too

  template <class Visitor>
  void Visit(Visitor& v) {
    v("ambient_dim", ambient_dim,
      "ambient coordinates; 0 for as many as held-out pixels gain by, decided before pretraining", Between(0, 16));
    v("num_octaves", num_octaves, "octaves of the positional encoding of x, beside the identity", Between(0, 20));
    v("depth", depth, "hidden layers", Between(1, 32));
    v("width", width, "neurons per hidden layer", Between(1, 4096));
    v("skip_layer", skip_layer, "layer before which the input is concatenated again; 0 for never", Between(0, 32));
    v("output_init", output_init, "standard deviation of the output layer's initial weights", AtLeast(0));
  }
};

// Hyperspace NeRF (c, sigma) = H(x' (+) ambient, d, alpha_t), eq. (4), as networks of the paper's size.
struct HyperspaceNerfConfig {
  int64_t num_octaves = 8;               // of x', plus identity
  int64_t ambient_octaves = 1;           // of the ambient coordinates, without identity
  int64_t ambient_window_delay = 1000;   // steps during which the ambient window stays closed
  int64_t ambient_window_steps = 10000;  // steps over which it then opens
  int64_t depth = 8;
  int64_t width = 256;
  int64_t skip_layer = 4;
  int64_t color_width = 128;  // the one colour layer

  template <class Visitor>
  void Visit(Visitor& v) {
    v("num_octaves", num_octaves, "octaves of the positional encoding of x', beside the identity", Between(0, 20));
    v("ambient_octaves", ambient_octaves, "octaves of the ambient coordinates, without identity", Between(1, 20));
    v("ambient_window_delay", ambient_window_delay, "steps during which the ambient window stays closed", AtLeast(0));
    v("ambient_window_steps", ambient_window_steps, "steps over which the ambient window then opens", AtLeast(0));
    v("depth", depth, "hidden layers of the trunk", Between(1, 32));
    v("width", width, "neurons per hidden layer of the trunk", Between(1, 4096));
    v("skip_layer", skip_layer, "layer before which the input is concatenated again; 0 for never", Between(0, 32));
    v("color_width", color_width, "neurons of the colour layer", Between(1, 4096));
  }
};

// A multiresolution hash encoding (Mueller et al., SIGGRAPH 2022) of a box in scene units.
struct HashEncodingConfig {
  int64_t num_levels = 16;
  int64_t features_per_level = 2;
  int64_t log2_table_size = 15;
  double base_resolution = 16;  // cells along the longest side of the box, coarsest level
  double finest_resolution = 512;

  template <class Visitor>
  void Visit(Visitor& v) {
    v("num_levels", num_levels, "resolutions", Between(1, 32));
    v("features_per_level", features_per_level, "features stored per table entry", Between(1, 8));
    v("log2_table_size", log2_table_size, "binary logarithm of the entries per level", Between(4, 24));
    v("base_resolution", base_resolution, "cells along the box at the coarsest level", Between(1, 65536));
    v("finest_resolution", finest_resolution, "cells along the box at the finest level", Between(1, 65536));
  }
};

// The fast field: the same hyperspace, spanned by (x', x' - p): one hash encoding for what stays, one for what moves
// with the key point, and small networks for density and colour.
struct FastFieldConfig {
  HashEncodingConfig canonical_hash;  // over x'
  HashEncodingConfig local_hash;      // over x' - p
  double local_extent = 0.5;          // side of the cube around p that local_hash covers, of the scene's longest side
  int64_t local_window_steps = 0;     // steps of training over which the finer half of local_hash comes in
  Choice local_frames = Choice::kOn;  // of parts that turn, so that they stand still in local_hash; on while undecided
  bool shade = false;                 // what a part casts on others and on what stands still, with several key points
  HashEncodingConfig shade_hash = {6, 2, 15, 8, 128};  // over x' - k_i, for the colour alone
  double shade_along_light = 0.25;                     // of a length along the light, as the encoding of shade sees it
  int64_t ambient_octaves = 2;    // of pretraining's ambient coordinates, for the density network, beside the identity
  int64_t key_point_octaves = 2;  // of the key point's, in training
  int64_t ambient_window_delay = 0;  // steps of pretraining during which the scene is taken as static
  int64_t ambient_window_steps = 0;  // steps over which the ambient coordinates then come in
  int64_t density_depth = 1;         // hidden layers
  int64_t color_depth = 2;
  int64_t width = 64;
  int64_t geometry_features = 15;  // passed from the density to the colour network
  double density_bias = 0.0;       // added to the pre-activation
  std::string kernel = "auto";     // how the CPU evaluates it: see kernels/fused_field.h

  template <class Visitor>
  void Visit(Visitor& v) {
    v("canonical_hash", canonical_hash, "hash encoding over x'");
    v("local_hash", local_hash, "hash encoding over x' - p; pretraining does not build it");
    v("local_extent", local_extent,
      "side of the cube around p that local_hash covers, as a share of the scene's longest side", Between(0.01, 2));
    v("local_window_steps", local_window_steps, "steps of training over which the finer half of local_hash comes in",
      AtLeast(0));
    v("local_frames", local_frames,
      "turn local_hash with the parts of which detection found that they turn as their key points move");
    v("shade", shade,
      "with several key points, let the colour see every place from each of them, whichever governs it: shadows that a "
      "part casts on the others and on what stands still");
    v("shade_along_light", shade_along_light,
      "of a length along the light, as shade_hash sees it, where detection has found the light's direction: shadows "
      "hardly change along it",
      Between(0.01, 1));
    v("shade_hash", shade_hash, "hash encoding over x' - k of each key point, for shade, in a cube as local_hash's");
    v("ambient_octaves", ambient_octaves,
      "octaves of pretraining's ambient coordinates, fed to the density network beside the identity", Between(0, 10));
    v("key_point_octaves", key_point_octaves,
      "octaves of the key point's local coordinates, fed to the density network beside the identity (training)",
      Between(0, 10));
    v("ambient_window_delay", ambient_window_delay, "steps of pretraining during which the scene is taken as static",
      AtLeast(0));
    v("ambient_window_steps", ambient_window_steps, "steps over which the ambient coordinates then come in",
      AtLeast(0));
    v("density_depth", density_depth, "hidden layers of the density network", Between(1, 8));
    v("color_depth", color_depth, "hidden layers of the colour network", Between(1, 8));
    v("width", width, "neurons per hidden layer", Between(8, 1024));
    v("geometry_features", geometry_features, "features passed from the density to the colour network", Between(1, 64));
    v("density_bias", density_bias, "added to the density pre-activation", Between(-20, 20));
    v("kernel", kernel,
      "how the CPU evaluates the field: 'fp32' in one fused pass, 'bf16' in one with the networks' products in "
      "bfloat16, "
      "'modules' one LibTorch module after the other; 'auto' is bf16 where the processor has a matrix unit for it "
      "(AMX), "
      "else fp32",
      OneOf{{"auto", "bf16", "fp32", "modules"}});
  }
};

struct FieldConfig {
  std::string kind = "paper";
  WarpFieldConfig warp;
  Choice use_appearance = Choice::kOn;  // alpha_t in the colour branch; off while undecided
  int64_t appearance_dim = 4;
  Choice use_view_direction = Choice::kOn;  // d in the colour branch; on while undecided
  int64_t direction_octaves = 4;
  double code_init = 0.05;  // codes start as U(0, code_init)
  SlicingNetworkConfig slicing;
  WeightNetworkConfig weights;
  HyperspaceNerfConfig nerf;
  FastFieldConfig fast;

  // Whether the component is built, while it is undecided too.
  bool HasWarp() const { return warp.enabled == Choice::kOn; }
  bool HasAppearance() const { return use_appearance == Choice::kOn; }
  bool HasViewDirection() const { return use_view_direction != Choice::kOff; }
  bool HasShade() const { return kind == "fast" && fast.shade; }
  bool HasLocalFrames() const { return kind == "fast" && fast.local_frames != Choice::kOff; }

  template <class Visitor>
  void Visit(Visitor& v) {
    v("kind", kind, "parameterisation of the hyperspace", OneOf{{"paper", "fast"}});
    v("warp", warp, "SE(3) warp field");
    v("use_appearance", use_appearance, "give the colour branch an appearance code per frame");
    v("appearance_dim", appearance_dim, "dimensions of the appearance code alpha_t", Between(1, 256));
    v("use_view_direction", use_view_direction, "give the colour branch the view direction");
    v("direction_octaves", direction_octaves, "octaves of the view direction, beside the identity", Between(0, 10));
    v("code_init", code_init, "per-frame codes start uniform in [0, code_init]", AtLeast(0));
    v("slicing", slicing, "slicing network of the pretraining stage");
    v("weights", weights, "softmax weight network; built for two key points or more");
    v("nerf", nerf, "the paper's networks (kind: paper)");
    v("fast", fast, "the fast field (kind: fast)");
  }
};

}  // namespace editnerf
