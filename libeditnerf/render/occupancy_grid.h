// Where a field has density, as one bit per cell of a box, so that empty space is never evaluated.
//
// Every cell keeps the largest density seen in it, forgotten slowly: at each visit d <- max(decay * d, density(x)) for
// a random x in the cell. A cell is occupied when d reaches the density whose opacity over one march step is the
// threshold, but in any case when d reaches half the mean over the cells: an untrained field, thin everywhere, is
// occupied everywhere. Occupied cells are dilated by one cell. Both that and a slow decay cost some samples and keep
// what moves: x is drawn with a random state at every visit, so that a swept volume stays occupied.
//
// As a torch::nn::Module whose state is all in buffers, it travels in checkpoints and across devices.
#pragma once

#include <torch/nn/module.h>
#include <torch/types.h>

#include <cstdint>
#include <functional>

#include "libeditnerf/geometry/box.h"

namespace editnerf {

// The box of everything between `near` and `far` along rays (origin, direction [R, 3]), grown by `margin` of its sides.
Box BoxAroundRays(const torch::Tensor& origin, const torch::Tensor& direction, double near, double far,
                  double margin = 0.01);

struct OccupancyOptions {
  int64_t resolution = 64;  // cells along each side
  double threshold = 0.01;  // opacity over one step
  double step = 0.01;       // scene units
  double decay = 0.95;      // of the remembered density, at each visit of a cell
  int64_t warm_up = 4;      // updates that visit every cell; later ones visit a quarter as many
  bool dilate = true;
};

class OccupancyGrid : public torch::nn::Module {
 public:
  // density of points [S, 3] -> [S]
  using DensityFunction = std::function<torch::Tensor(const torch::Tensor& x)>;

  // Throws ConfigError unless the box has a volume and the step is positive. Starts occupied everywhere.
  OccupancyGrid(const Box& box, const OccupancyOptions& options);

  // x [..., 3] -> bool [...]; false outside the box.
  torch::Tensor Occupied(const torch::Tensor& x) const;
  torch::Tensor Inside(const torch::Tensor& x) const;

  // Visits all cells during warm-up, later an eighth of all at random and as many occupied ones. No gradients.
  void Update(const DensityFunction& density);

  // Visits all cells and forgets nothing: makes room for states that training never showed, such as edits.
  void Cover(const DensityFunction& density);

  double OccupiedShare() const;

 private:
  torch::Tensor AllCells() const;                            // [resolution^3] int64
  torch::Tensor VisitedCells() const;                        // [V] int64
  torch::Tensor PointsIn(const torch::Tensor& cells) const;  // [V, 3], a random point in each
  void Visit(const torch::Tensor& cells, const DensityFunction& density, double decay);
  void UpdateBits();

  OccupancyOptions options_;
  torch::Tensor low_, high_;  // [3] float64
  torch::Tensor density_;     // [resolution^3] float32, x slowest
  torch::Tensor occupied_;    // [resolution^3] bool
  torch::Tensor updates_;     // int64
};

}  // namespace editnerf
