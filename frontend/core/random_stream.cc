#include "frontend/core/random_stream.h"

#include <bit>
#include <cmath>
#include <numbers>

#include "frontend/core/error.h"

namespace cohort {
namespace {

std::uint64_t SplitMix64(std::uint64_t& x) {
  x += 0x9e3779b97f4a7c15ULL;
  std::uint64_t z = x;
  z = (z ^ (z >> 30)) * 0xbf58476d1ce4e5b9ULL;
  z = (z ^ (z >> 27)) * 0x94d049bb133111ebULL;
  return z ^ (z >> 31);
}

std::uint64_t HashName(std::uint64_t seed, std::string_view name) {
  std::uint64_t hash = 0xcbf29ce484222325ULL ^ seed;  // FNV-1a
  for (const char c : name) {
    hash ^= static_cast<unsigned char>(c);
    hash *= 0x100000001b3ULL;
  }
  return SplitMix64(hash);
}

}  // namespace

RandomStream::RandomStream(std::uint64_t seed, std::string_view name)
    : RandomStream(HashName(seed, name)) {}

RandomStream::RandomStream(std::uint64_t key) : key_(key) {
  std::uint64_t x = key;
  for (auto& word : state_) word = SplitMix64(x);
}

RandomStream RandomStream::Fork(std::uint64_t index) const {
  std::uint64_t x = key_ + 0x632be59bd9b4e019ULL * (index + 1);
  return RandomStream(SplitMix64(x));
}

std::uint64_t RandomStream::Bits() {
  const std::uint64_t result = std::rotl(state_[1] * 5, 7) * 9;
  const std::uint64_t t = state_[1] << 17;
  state_[2] ^= state_[0];
  state_[3] ^= state_[1];
  state_[1] ^= state_[2];
  state_[0] ^= state_[3];
  state_[2] ^= t;
  state_[3] = std::rotl(state_[3], 45);
  return result;
}

double RandomStream::Uniform() { return static_cast<double>(Bits() >> 11) * 0x1.0p-53; }

double RandomStream::Uniform(double min, double max) { return min + (max - min) * Uniform(); }

std::uint64_t RandomStream::Below(std::uint64_t n) {
  Check(n > 0, "RandomStream::Below needs n > 0");
  const std::uint64_t limit = ~std::uint64_t{0} - ~std::uint64_t{0} % n;  // rejects the uneven rest
  std::uint64_t bits = Bits();
  while (bits >= limit) bits = Bits();
  return bits % n;
}

double RandomStream::Gaussian() {
  if (has_spare_) {
    has_spare_ = false;
    return spare_;
  }
  const double radius = std::sqrt(-2.0 * std::log(1.0 - Uniform()));
  const double angle = 2.0 * std::numbers::pi * Uniform();
  spare_ = radius * std::sin(angle);
  has_spare_ = true;
  return radius * std::cos(angle);
}

}  // namespace cohort
