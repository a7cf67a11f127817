#pragma once

#include <cstdint>
#include <cstring>

// Vectors of eight floats. GCC and Clang map them to what the machine has (one AVX register, two of
// SSE or NEON), and sums have the same order on every machine.

// A function with this mark is compiled twice, and the wider version is chosen at run time. It uses
// no fused multiply-add, so that both give the same bytes.
#if defined(__x86_64__) && defined(__GNUC__) && !defined(__clang__) && \
    !defined(__SANITIZE_ADDRESS__)
#define COHORT_SIMD_CLONES __attribute__((target_clones("avx2", "default")))
#else
#define COHORT_SIMD_CLONES
#endif

#pragma GCC diagnostic ignored "-Wpsabi"  // on passing lanes: all is inlined
#define COHORT_LANES_INLINE __attribute__((always_inline)) inline

namespace cohort {

constexpr int kLanes = 8;
using FloatLanes = float __attribute__((vector_size(4 * kLanes)));
using IntLanes = std::int32_t __attribute__((vector_size(4 * kLanes)));

// The number of floats that a row of n takes in whole lanes.
constexpr int RoundUpToLanes(int n) { return (n + kLanes - 1) / kLanes * kLanes; }

COHORT_LANES_INLINE FloatLanes LoadLanes(const float* from) {
  FloatLanes lanes;
  std::memcpy(&lanes, from, sizeof(lanes));
  return lanes;
}

COHORT_LANES_INLINE void StoreLanes(const FloatLanes& lanes, float* to) {
  std::memcpy(to, &lanes, sizeof(lanes));
}

// 0, 1, ... 7.
COHORT_LANES_INLINE FloatLanes LaneNumbers() {
  return FloatLanes{0.0F, 1.0F, 2.0F, 3.0F, 4.0F, 5.0F, 6.0F, 7.0F};
}

// All bits set in the first `count` lanes.
COHORT_LANES_INLINE IntLanes FirstLanes(int count) {
  const IntLanes numbers{0, 1, 2, 3, 4, 5, 6, 7};
  return numbers < count;
}

// The lanes of the mask, 0 in the others, whatever their contents.
COHORT_LANES_INLINE FloatLanes Masked(const FloatLanes& lanes, const IntLanes& mask) {
  IntLanes bits;
  std::memcpy(&bits, &lanes, sizeof(bits));
  bits &= mask;
  FloatLanes masked;
  std::memcpy(&masked, &bits, sizeof(masked));
  return masked;
}

COHORT_LANES_INLINE FloatLanes Absolute(const FloatLanes& lanes) {
  return Masked(lanes, IntLanes{} + 0x7fffffff);
}

COHORT_LANES_INLINE double SumOf(const FloatLanes& lanes) {
  double sum = 0.0;
  for (int l = 0; l < kLanes; ++l) sum += static_cast<double>(lanes[l]);
  return sum;
}

}  // namespace cohort
