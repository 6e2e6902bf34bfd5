// Multiresolution hash encoding of points in the unit cube (Mueller et al., SIGGRAPH 2022).
//
// Level l divides the cube into resolutions[l] cells along each axis; the corner features of the cell that holds x are
// interpolated trilinearly. A level whose (resolution + 1)^3 corners fit into the table is stored densely; finer ones
// hash as (i + h(j, k)) mod T, which keeps the two corners along the first axis adjacent in memory.
#pragma once

#include <ATen/core/Tensor.h>

#include <cstdint>
#include <vector>

namespace editnerf {

// x [S, 3] in [0, 1], clamped from outside (a NaN counts as 0, and clamped coordinates have zero gradient);
// table [L, T, F] with T a power of two; resolutions: L cells per axis, each >= 1. Returns [S, L * F], level-major.
// Differentiable once in x and table. float32 and float64; on the CPU a threaded loop whose result does not depend on
// the number of threads, elsewhere HashEncodeReference. Throws ShapeError for other shapes or types.
at::Tensor HashEncode(const at::Tensor& x, const at::Tensor& table, const std::vector<int64_t>& resolutions);

// The same in plain LibTorch operations: what the loops are tested against, and what runs on other devices.
at::Tensor HashEncodeReference(const at::Tensor& x, const at::Tensor& table, const std::vector<int64_t>& resolutions);

// Resolutions growing geometrically from `base` to `finest` over `levels`, rounded down.
std::vector<int64_t> HashResolutions(int64_t levels, double base, double finest);

}  // namespace editnerf
