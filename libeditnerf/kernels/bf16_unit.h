// What this processor has for products in bfloat16: tiles (AMX), or pairs in vectors (AVX-512 BF16).
#pragma once

#include <cstdint>
#include <vector>

namespace editnerf {

enum class Bf16Unit {
  kNone,
  kVectors,  // vdpbf16ps: twice float32's speed on some processors, half of it on others
  kTiles,    // tdpbf16ps: about ten times
};

// The fastest that this processor has. Asks the system once for leave to use tiles.
Bf16Unit FastestBf16();

// While one lives, this processor passes for one that has no more than `most`: what a run meets elsewhere, tried here.
class Bf16Limit {
 public:
  explicit Bf16Limit(Bf16Unit most);
  ~Bf16Limit();
  Bf16Limit(const Bf16Limit&) = delete;
  Bf16Limit& operator=(const Bf16Limit&) = delete;

 private:
  Bf16Unit before_;
};

std::vector<Bf16Unit> Bf16UnitsHere();  // all that it has, the fastest last

// "no bfloat16", "AVX-512 BF16", "AMX BF16".
const char* NameOf(Bf16Unit unit);

// To the nearest bfloat16, ties to even; a NaN stays one.
uint16_t ToBf16(float value);
float FromBf16(uint16_t value);

}  // namespace editnerf
