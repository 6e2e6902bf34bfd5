// What the processor can do at most, for benchmarks to compare with.
#pragma once

#include <string>

namespace editnerf {

// Name of the instruction set that Highway's kernels run with here ("AVX3_DL", "AVX2", "NEON", ...).
std::string InstructionSet();

// Multiply-adds (two operations each) of float32 vectors that never leave the registers: operations per second and
// core while NumThreads() threads do the same, by processor time, the largest of several short loops.
double MeasurePeakFlops();

}  // namespace editnerf
