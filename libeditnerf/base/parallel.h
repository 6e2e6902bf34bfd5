// Loops over the library's own threads. LibTorch's at::parallel_for is silently serial when the including file is not
// compiled for the OpenMP runtime that LibTorch was built with, so the kernels do not use it.
#pragma once

#include <cstdint>
#include <functional>

namespace editnerf {

// Threads for LibTorch's operations and for ParallelFor; 0 takes every core that this process may use. Not thread-safe:
// call it once at the start.
void SetNumThreads(int64_t count);
int64_t NumThreads();

// Calls body(begin, end) on disjoint ranges that cover [0, count), each of at least `grain` (> 0) items but the last
// one; returns when all are done. The division depends on count, grain and NumThreads() alone. An exception in `body`
// is rethrown here. Nested calls run serially.
void ParallelFor(int64_t count, int64_t grain, const std::function<void(int64_t, int64_t)>& body);

// The same with one item a call, for bodies that run LibTorch's operations: inside, those and OpenBLAS take one thread
// each, so that the parts do not fight for the cores.
void ParallelParts(int64_t count, const std::function<void(int64_t)>& body);

}  // namespace editnerf
