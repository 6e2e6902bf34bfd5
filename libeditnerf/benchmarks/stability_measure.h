// How errors of operators are measured, and with which precisions and instruction sets operators are run.
#pragma once

#include <ATen/core/Tensor.h>

#include <functional>
#include <string>
#include <vector>

#include "libeditnerf/benchmarks/stability_cases.h"
#include "libeditnerf/kernels/tile.h"

namespace editnerf {

// References are computed in this type: 64 bits of mantissa on x86, at least those of double elsewhere.
using Real = long double;

struct Precision {
  std::string name;  // "float64"
  at::ScalarType type;
  double rounding;  // half the distance from 1 to the next number
};

const std::vector<Precision>& Precisions();  // float64, float32
const Precision& SinglePrecision();

// Largest |found - expected| / max(|expected|, floor) over all elements. Equal infinities and two NaNs agree; whatever
// else is not finite makes it infinite.
double LargestRelativeError(const at::Tensor& found, const at::Tensor& expected, double floor);

// The same relative to the largest element of each row (the last dimension), where sums of both signs cancel.
double LargestErrorOfRows(const at::Tensor& found, const at::Tensor& expected, double floor);

// Whether all of them are finite.
bool AllFinite(const std::vector<at::Tensor>& tensors);

// Calls body(name) once with the kernels of every instruction set that this machine and this build have.
void ForEachInstructionSet(const std::function<void(const std::string& name)>& body);

// [rows, count] to and from a tile (kernels/tile.h); columns behind `count` are NaN, so that a kernel that lets them
// reach a result is found out.
void FillTile(const at::Tensor& values, TileMemory* tile);
at::Tensor ReadTile(const TileMemory& tile, int64_t rows, int64_t count);  // float32

}  // namespace editnerf
