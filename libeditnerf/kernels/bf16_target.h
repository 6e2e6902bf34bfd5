// For the files that are written for these instructions; Highway has none for them in the versions that distributions
// ship, so they are the compiler's own, in functions that run where FastestBf16 (bf16_unit.h) says so.
#pragma once

#if defined(__x86_64__) && defined(__linux__)
#define EDITNERF_BF16 1
#include <immintrin.h>
#define EDITNERF_VECTORS __attribute__((target("avx512f,avx512bw,avx512dq,avx512vl,avx512bf16")))
#define EDITNERF_TILES __attribute__((target("avx512f,avx512bw,avx512dq,avx512vl,avx512bf16,amx-tile,amx-bf16")))
#endif
