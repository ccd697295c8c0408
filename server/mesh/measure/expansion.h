// Exact sums and products of doubles; private to this folder.
//
// Shewchuk, "Adaptive Precision Floating-Point Arithmetic and Fast Robust Geometric Predicates",
// Discrete & Computational Geometry 18, 1997. A number is the sum of doubles that do not overlap.
#pragma once

#include <array>
#include <cmath>
#include <cstddef>

namespace isomesh::mesh {

// Exact while no operation overflows or underflows. Products of three differences of floats, and
// their sums, do neither: their digits lie between 2^-447 and 2^390.
class Expansion {
 public:
  // The exact difference of two doubles.
  static Expansion difference(double a, double b) {
    Expansion result;
    result.add(a);
    result.add(-b);
    return result;
  }

  friend Expansion operator*(const Expansion& a, const Expansion& b) {
    Expansion result;
    for (std::size_t i = 0; i < a.size_; ++i) {
      for (std::size_t j = 0; j < b.size_; ++j) {
        const double product = a.parts_[i] * b.parts_[j];
        result.add(std::fma(a.parts_[i], b.parts_[j], -product));  // what the rounding left
        result.add(product);
      }
    }
    return result;
  }

  Expansion& operator+=(const Expansion& other) {
    for (std::size_t i = 0; i < other.size_; ++i) add(other.parts_[i]);
    return *this;
  }

  Expansion& operator-=(const Expansion& other) {
    for (std::size_t i = 0; i < other.size_; ++i) add(-other.parts_[i]);
    return *this;
  }

  // -1, 0 or 1. The last part is larger than all others together.
  int sign() const {
    if (size_ == 0) return 0;
    return parts_[size_ - 1] > 0 ? 1 : -1;
  }

 private:
  // Three products of a difference and two products of two differences: 3 * 2 * 2 * (8 + 8).
  static constexpr std::size_t kMostParts = 192;

  // Grow-Expansion, without the zeros.
  void add(double value) {
    std::size_t kept = 0;
    for (std::size_t i = 0; i < size_; ++i) {
      const double part = parts_[i];
      const double sum = value + part;
      const double of_part = sum - value;
      const double rest = (value - (sum - of_part)) + (part - of_part);
      if (rest != 0) parts_[kept++] = rest;
      value = sum;
    }
    if (value != 0) parts_[kept++] = value;
    size_ = kept;
  }

  std::array<double, kMostParts>
      parts_;  // of growing magnitude, none of them 0; only the first `size_` are set
  std::size_t size_ = 0;
};

}  // namespace isomesh::mesh
