#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <utility>
#include <vector>

namespace cohort {

// Removes the features with keep[f] == 0; the others keep their order. A tracker numbers its
// features 0 .. F - 1, and everything that it stores of them is in this order.
template <typename T>
void KeepOnly(std::span<const std::uint8_t> keep, std::vector<T>& features) {
  std::size_t kept = 0;
  for (std::size_t f = 0; f < keep.size(); ++f) {
    if (keep[f] == 0) continue;
    if (kept != f) features[kept] = std::move(features[f]);
    ++kept;
  }
  features.resize(kept);
}

// The same for the columns of a matrix.
template <typename Matrix>
void KeepOnly(std::span<const std::uint8_t> keep, Matrix& columns) {
  decltype(columns.cols()) kept = 0;
  for (std::size_t f = 0; f < keep.size(); ++f) {
    if (keep[f] != 0) columns.col(kept++) = columns.col(static_cast<decltype(kept)>(f));
  }
  columns.conservativeResize(columns.rows(), kept);
}

}  // namespace cohort
