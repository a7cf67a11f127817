#pragma once

#include <cstdint>
#include <string_view>

namespace cohort {

// A named stream of random numbers: the same (seed, name) gives the same numbers on every machine
// and for every thread count. Give each use its own name, and each frame its own Fork(frame index).
// splitmix64 seeds xoshiro256**; Gaussian() is Box-Muller (std::normal_distribution differs between
// standard libraries).
class RandomStream {
 public:
  RandomStream(std::uint64_t seed, std::string_view name);

  RandomStream Fork(std::uint64_t index) const;

  std::uint64_t Bits();
  double Uniform();                        // [0, 1)
  double Uniform(double min, double max);  // [min, max)
  std::uint64_t Below(std::uint64_t n);    // 0 .. n - 1, n > 0
  double Gaussian();                       // mean 0, variance 1

 private:
  explicit RandomStream(std::uint64_t key);

  std::uint64_t key_;
  std::uint64_t state_[4] = {};
  double spare_ = 0.0;
  bool has_spare_ = false;
};

}  // namespace cohort
