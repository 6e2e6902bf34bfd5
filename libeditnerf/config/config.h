// The whole configuration of a run: what configs/*.yaml hold and what is saved with every run.
#pragma once

#include <cstdint>
#include <string>

#include "libeditnerf/config/field_config.h"
#include "libeditnerf/config/fields.h"

namespace editnerf {

struct DataConfig {
  int64_t image_factor = 0;  // rgb/<factor>x; 0: the smallest factor that brings the longer side to max_side or below
  int64_t max_side = 320;
  std::string hold_out = "auto";  // frames kept from training where the scene has no validation frames of its own

  template <class Visitor>
  void Visit(Visitor& v) {
    v("image_factor", image_factor, "use rgb/<factor>x; 0 picks the smallest factor that respects max_side",
      Between(0, 64));
    v("max_side", max_side, "longest image side in pixels when image_factor is 0", Between(16, 16384));
    v("hold_out", hold_out,
      "where the scene names no validation frames: 'odd' keeps every second frame from training, as the paper does for "
      "real captures; 'eighth' every eighth; 'none' trains on all; 'auto' is 'eighth' from 16 frames on",
      OneOf{{"auto", "eighth", "odd", "none"}});
  }
};

struct RenderConfig {
  std::string sampler = "hierarchical";  // hierarchical: stratified, then from the coarse weights; occupancy: marching
  int64_t coarse_samples = 128;
  int64_t fine_samples = 128;
  int64_t march_steps = 192;  // candidates between near and far
  int64_t occupancy_resolution = 64;
  int64_t occupancy_update_every = 16;  // steps
  double occupancy_threshold = 0.01;    // of alpha over one candidate step
  double early_stop = 1e-3;             // transmittance at which a ray ends

  template <class Visitor>
  void Visit(Visitor& v) {
    v("sampler", sampler, "where samples lie along a ray", OneOf{{"hierarchical", "occupancy"}});
    v("coarse_samples", coarse_samples, "stratified samples per ray (hierarchical)", Between(2, 4096));
    v("fine_samples", fine_samples, "further samples from the coarse weights (hierarchical)", Between(0, 4096));
    v("march_steps", march_steps, "candidate samples between near and far (occupancy)", Between(2, 4096));
    v("occupancy_resolution", occupancy_resolution, "cells along each side of the occupancy grid", Between(8, 512));
    v("occupancy_update_every", occupancy_update_every, "steps between occupancy updates", AtLeast(1));
    v("occupancy_threshold", occupancy_threshold, "opacity of one step from which a cell counts as occupied",
      Between(0, 1));
    v("early_stop", early_stop, "transmittance at which a ray ends", Between(0, 0.5));
  }
};

// Optimisation of one stage (pretraining or training).
struct StageConfig {
  int64_t steps = 250000;
  double seconds = 0;                    // training seconds after which the stage ends; 0: no limit
  int64_t rays_per_step = 6144;          // 4 x 1536
  int64_t samples_per_step = 0;          // fewer rays are drawn where they would take more samples; 0: no limit
  double learning_rate = 1e-3;           // exponential from here
  double final_learning_rate = 1e-4;     // to here, over `steps` (or `seconds`, whichever is nearer its end)
  bool average_weights = false;          // what is shown is their mean over about the last fifth of the steps
  double key_point_learning_rate = 1.0;  // multiplies the learning rate of key points
  double turn_learning_rate = 1e-4;      // multiplies the learning rate of local frames
  int64_t settle_after = 0;              // steps after which both fall as one over the steps; 0: never
  double code_learning_rate = 1.0;       // multiplies the learning rate of the per-frame codes
  double shape_learning_rate = 1.0;      // multiplies the learning rate of warp field, slices and weights
  double roulette = 0;                   // see RayLoss
  double shade_decay = 0;                // decay of the shade encoding, see AdamGroup
  double lambda_motion = 1e-4;           // of squared pixels at reference_width
  double reference_width = 320;          // image width that lambda_motion's pixels refer to
  double lambda_geometry = 0.5;
  double lambda_warp = 0.1;
  double lambda_ambient = 0;     // of the squared ambient coordinates at surface points (pretraining)
  double lambda_distortion = 0;  // of the distortion loss of mip-NeRF 360, in normalised ray distance
  double lambda_depth = 0;       // of the share of the depth by which a known distance is missed
  double still_share = 0;        // of the rays: through what stands still, under key points drawn anew
  double carried_share = 0;      // of the rays: through what a key point carries, carried along to other states
  double error_share = 0;        // of the rays: drawn by how far off the images still are, see ErrorMap
  int64_t trial_steps = 500;     // for every component of the field that is left to auto; 0: no trials
  Choice merge_key_points = Choice::kOff;  // those that move as one part, in training
  bool warm_start = false;                 // of training: begin with the static scene that pretraining found
  bool random_background = false;          // composite on random colours after 200 steps
  int64_t log_every = 50;                  // steps
  int64_t evaluate_every = 2000;           // steps between held-out measurements; 0: none
  int64_t checkpoint_every = 5000;         // steps
  bool dump_bad_steps = false;             // write down the first steps that are not finite

  template <class Visitor>
  void Visit(Visitor& v) {
    v("steps", steps, "optimisation steps", AtLeast(1));
    v("seconds", seconds, "training seconds after which the stage ends; 0 for no limit", AtLeast(0));
    v("rays_per_step", rays_per_step, "rays per step", Between(1, 1 << 20));
    v("samples_per_step", samples_per_step,
      "samples that a step may take: fewer rays are drawn while they take many; 0 for no limit", AtLeast(0));
    v("learning_rate", learning_rate, "initial learning rate of Adam", Positive());
    v("final_learning_rate", final_learning_rate, "learning rate at the end of the exponential schedule", Positive());
    v("average_weights", average_weights,
      "show and save the mean of the weights over about the last fifth of the steps, which lets the learning rate stay "
      "high");
    v("key_point_learning_rate", key_point_learning_rate, "factor on the learning rate for key points", AtLeast(0));
    v("turn_learning_rate", turn_learning_rate, "factor on the learning rate for how parts turn with their key points",
      AtLeast(0));
    v("settle_after", settle_after,
      "steps after which the rates of key points and of turns fall as one over the number of steps; 0 for never",
      AtLeast(0));
    v("code_learning_rate", code_learning_rate, "factor on the learning rate for per-frame codes", AtLeast(0));
    v("shape_learning_rate", shape_learning_rate,
      "factor on the learning rate for the warp field, the slicing and the weight network", AtLeast(0));
    v("roulette", roulette,
      "Russian roulette: samples whose gradients are below this (of a ray's squared error, by the density's logarithm "
      "and the colour before its sigmoid) go back through the networks by lot, right on the mean; fast field on a CPU "
      "alone; 0: all go back",
      Between(0, 1));
    v("shade_decay", shade_decay,
      "how fast what is not needed of field.fast.shade is forgotten: the learning rate times this, in every step "
      "(training)",
      Between(0.0, 100.0));
    v("lambda_motion", lambda_motion, "weight of the motion loss, per squared pixel at reference_width", AtLeast(0));
    v("reference_width", reference_width, "image width to which lambda_motion's pixels refer", Positive());
    v("lambda_geometry", lambda_geometry, "weight of the geometry loss", AtLeast(0));
    v("lambda_warp", lambda_warp, "weight of the warp regularisation", AtLeast(0));
    v("lambda_ambient", lambda_ambient, "weight of the squared ambient coordinates (pretraining)", AtLeast(0));
    v("lambda_distortion", lambda_distortion, "weight of the distortion loss", AtLeast(0));
    v("lambda_depth", lambda_depth,
      "weight of missing the static scene's triangulated distances, as a share of them (pretraining)", AtLeast(0));
    v("still_share", still_share,
      "share of the rays that go through places known to stand still and must show them with the key points anywhere "
      "(training)",
      Between(0.0, 0.4));
    v("carried_share", carried_share,
      "share of the rays that go through places of a part that moves, carried along with it to where it was at other "
      "times, and must show the same there, with the other parts' key points anywhere (training; not where parts turn)",
      Between(0.0, 0.35));
    v("error_share", error_share,
      "share of the rays that go through cells of 8 x 8 pixels drawn by how far off those still are; rays count by "
      "their chances, so that the loss remains the mean over all pixels",
      Between(0.0, 0.8));
    v("trial_steps", trial_steps,
      "steps of each short training that decides a component of the field left to auto; 0 for none", AtLeast(0));
    v("merge_key_points", merge_key_points,
      "merge key points that move as one rigid part: true, false, or auto, where held-out pixels do not miss the "
      "second one (training)");
    v("warm_start", warm_start,
      "begin with the static scene that pretraining found, where the field is of the same kind (training)");
    v("random_background", random_background, "composite on random colours once the field has taken shape");
    v("log_every", log_every, "steps between rows of metrics.csv", AtLeast(1));
    v("evaluate_every", evaluate_every, "steps between held-out measurements; 0 for none", AtLeast(0));
    v("checkpoint_every", checkpoint_every, "steps between checkpoints", AtLeast(1));
    v("dump_bad_steps", dump_bad_steps,
      "write steps that are skipped because something is not finite to RUN/bad_steps, for enf-replay");
  }
};

// Optical flow between the training images, for detection and for depth from flow.
struct FlowConfig {
  std::string method = "auto";
  std::string weights;      // file; empty: none
  int64_t iterations = 12;  // of RAFT
  int64_t enlarge = 2;      // times, before RAFT
  bool refine = true;       // DIS from RAFT's flow

  template <class Visitor>
  void Visit(Visitor& v) {
    v("method", method,
      "'dis' is dense inverse search; 'raft' is RAFT, which takes weights; 'auto' is RAFT where weights are given",
      OneOf{{"auto", "dis", "raft"}});
    v("weights", weights,
      "file of RAFT's published weights, small or large: the authors' .pth, torchvision's .pth, or safetensors");
    v("iterations", iterations, "updates of RAFT", Between(1, 100));
    v("enlarge", enlarge, "whole factor by which images are enlarged for RAFT, which sees an eighth of their size",
      Between(1, 8));
    v("refine", refine, "let dense inverse search begin from RAFT's flow, for fractions of a pixel");
  }
};

// Key point detection and propagation (section 3.3 of the paper).
struct DetectionConfig {
  int64_t count = 0;  // number of key points; 0: as many as are found
  int64_t max_count = 8;
  int64_t volume_resolution = 96;    // voxels along the longest side
  int64_t min_observations = 6;      // frames that must have seen a voxel
  double smoothing = 2.0;            // standard deviation of the Gaussian, voxels
  double min_distance = 0.08;        // between maxima, of the volume's longest side
  double relative_threshold = 0.03;  // of the strongest maximum
  double reference_delta = 0.02;     // depth difference in the reference frame, of the point's distance
  int64_t skip_interval = 50;        // frames between attempts of skipping propagation; 0: never
  double skip_max_error = 5.0;       // forward-backward distance in pixels at 320 wide
  double merge_distance = 0.15;      // tracks nearer than this (of their motion range) are one part
  bool rigid_parts = true;           // key points on the rigid parts that flow shows; false: on the volume's maxima
  bool refine = true;                // robust least squares over every track

  template <class Visitor>
  void Visit(Visitor& v) {
    v("count", count, "number of key points; 0 keeps as many as are found", Between(0, 64));
    v("max_count", max_count, "most key points kept when count is 0", Between(1, 64));
    v("volume_resolution", volume_resolution, "voxels along the longest side of the canonical volume", Between(8, 512));
    v("min_observations", min_observations, "frames that must have seen a voxel", AtLeast(2));
    v("smoothing", smoothing, "standard deviation of the 3-D Gaussian, in voxels", AtLeast(0));
    v("min_distance", min_distance, "least distance of two maxima, as a share of the volume's longest side",
      Between(0, 1));
    v("relative_threshold", relative_threshold, "least height of a maximum, as a share of the strongest",
      Between(0, 1));
    v("reference_delta", reference_delta, "depth difference allowed in the reference frame, relative", Positive());
    v("skip_interval", skip_interval, "frames between attempts of skipping propagation; 0 for never", AtLeast(0));
    v("skip_max_error", skip_max_error, "forward-backward distance allowed for it, in pixels at 320 wide", Positive());
    v("merge_distance", merge_distance, "tracks nearer than this share of their motion range are one part", AtLeast(0));
    v("rigid_parts", rigid_parts,
      "key points on rigid parts fitted to flow tracks; false takes the maxima of the variance volume, as the paper "
      "does");
    v("refine", refine, "refine every track by robust least squares");
  }
};

struct Config {
  DataConfig data;
  FieldConfig field;
  RenderConfig render;
  StageConfig pretrain;
  StageConfig train;
  FlowConfig flow;
  DetectionConfig detect;

  template <class Visitor>
  void Visit(Visitor& v) {
    v("data", data, "images and splits");
    v("field", field, "networks and encodings");
    v("render", render, "samples along rays");
    v("pretrain", pretrain, "the HyperNeRF stage");
    v("train", train, "the key point stage");
    v("flow", flow, "optical flow between training images");
    v("detect", detect, "key point detection");
  }
};

}  // namespace editnerf
