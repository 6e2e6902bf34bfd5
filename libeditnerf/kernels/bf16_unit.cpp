#include "libeditnerf/kernels/bf16_unit.h"

#include <algorithm>
#include <atomic>
#include <cstring>

#include "libeditnerf/kernels/bf16_target.h"

#ifdef EDITNERF_BF16
#include <cpuid.h>
#include <sys/syscall.h>
#include <unistd.h>
#endif

namespace editnerf {
namespace {

std::atomic<Bf16Unit> limit{Bf16Unit::kTiles};

#ifdef EDITNERF_BF16

bool HasVectors() {
  unsigned a = 0, b = 0, c = 0, d = 0;
  return __builtin_cpu_supports("avx512bw") != 0 && __builtin_cpu_supports("avx512dq") != 0 &&
         __builtin_cpu_supports("avx512vl") != 0 && __get_cpuid_count(7, 1, &a, &b, &c, &d) != 0 && (a >> 5 & 1) != 0;
}

// The registers are large, so that Linux saves them only for processes that asked.
bool HasTiles() {
  unsigned a = 0, b = 0, c = 0, d = 0;
  if (__get_cpuid_count(7, 0, &a, &b, &c, &d) == 0 || (d >> 22 & 1) == 0 || (d >> 24 & 1) == 0) return false;
  constexpr long kRequestPermission = 0x1023, kTileData = 18;  // ARCH_REQ_XCOMP_PERM, XFEATURE_XTILEDATA
  return syscall(SYS_arch_prctl, kRequestPermission, kTileData) == 0;
}

Bf16Unit UnitHere() {
  if (!HasVectors()) return Bf16Unit::kNone;
  return HasTiles() ? Bf16Unit::kTiles : Bf16Unit::kVectors;
}

#else

Bf16Unit UnitHere() { return Bf16Unit::kNone; }

#endif

}  // namespace

Bf16Unit FastestBf16() {
  static const Bf16Unit unit = UnitHere();
  return std::min(unit, limit.load(std::memory_order_relaxed));
}

Bf16Limit::Bf16Limit(Bf16Unit most) : before_(limit.exchange(most)) {}
Bf16Limit::~Bf16Limit() { limit = before_; }

std::vector<Bf16Unit> Bf16UnitsHere() {
  std::vector<Bf16Unit> units;
  if (FastestBf16() != Bf16Unit::kNone) units.push_back(Bf16Unit::kVectors);
  if (FastestBf16() == Bf16Unit::kTiles) units.push_back(Bf16Unit::kTiles);
  return units;
}

const char* NameOf(Bf16Unit unit) {
  switch (unit) {
    case Bf16Unit::kNone:
      break;
    case Bf16Unit::kVectors:
      return "AVX-512 BF16";
    case Bf16Unit::kTiles:
      return "AMX BF16";
  }
  return "no bfloat16";
}

uint16_t ToBf16(float value) {
  uint32_t bits = 0;
  std::memcpy(&bits, &value, sizeof bits);
  if (value != value) return static_cast<uint16_t>(bits >> 16 | 0x40U);
  return static_cast<uint16_t>((bits + 0x7fffU + (bits >> 16 & 1U)) >> 16);
}

float FromBf16(uint16_t value) {
  const uint32_t bits = static_cast<uint32_t>(value) << 16;
  float result = 0;
  std::memcpy(&result, &bits, sizeof result);
  return result;
}

}  // namespace editnerf
