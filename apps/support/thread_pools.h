// Keeps the thread pools under LibTorch from fighting for the cores.
#pragma once

namespace editnerf {

// LibTorch's operations, OpenBLAS and the library's own loops each have a pool, and by default an idle OpenMP or
// OpenBLAS thread spins for milliseconds: on two cores that takes nine tenths of the time from whoever has work
// (measured: docs/benchmarks/README.md). Both read how long to spin from the environment when they are loaded, before
// main. So where the user has not chosen, this sets short times and starts the program again, once. Call it first in
// main.
void RestartWithShortSpins(char* const* argv);

}  // namespace editnerf
