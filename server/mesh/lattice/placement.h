// The position of a vertex on a lattice edge; private to the kernels.
#pragma once

#include <algorithm>
#include <cmath>
#include <type_traits>

#include "server/mesh/lattice/lattice.h"

namespace isomesh::mesh {

// The values of T that are inside, so that classifying compares T with T.
template <class T>
struct Threshold {
  T limit = {};  // the smallest value that is inside, or the largest
  Inside inside = Inside::kAbove;

  bool contains(T value) const {
    return inside == Inside::kAbove ? value >= limit : value <= limit;
  }
};

struct ExtractOptions {
  double iso = 0;
  Scheme scheme = Scheme::kSix;
  Interpolation interpolation = Interpolation::kLinear;
  bool close = false;              // cap the surface where it meets the lattice's border
  bool regularize = false;         // join crossings around a sample, see links.h
  Inside inside = Inside::kAbove;  // a sample is inside when its value is >= iso, or when it is not

  // The same for means of samples.
  bool contains(double value) const { return (value >= iso) == (inside == Inside::kAbove); }
};

// Immutable, so safe to read from several threads.
class Placement {
 public:
  Placement(const ExtractOptions& options, const Dims& dims, const LatticeToSpace& to_space)
      : iso_(options.iso),
        midpoint_(options.interpolation == Interpolation::kMidpoint),
        nearest_(nearest_share(dims, to_space)) {}

  // Keeps another distance from the samples; see nearest_share.
  Placement(const ExtractOptions& options, double nearest)
      : iso_(options.iso),
        midpoint_(options.interpolation == Interpolation::kMidpoint),
        nearest_(nearest) {}

  // The fraction of the way from a sample of value `from` to one of value `to`. The iso-value lies
  // between them.
  template <class T>
  double share(T from, T to) const {
    return midpoint_ ? 0.5
                     : share<T>(iso_, static_cast<double>(from), static_cast<double>(to), nearest_);
  }

  // The same for values of samples of type T, unless all vertices are midpoints.
  template <class T>
  static double share(double iso, double from, double to, double nearest) {
    double f = (iso - from) / (to - from);
    if constexpr (std::is_same_v<T, double>) {
      // The difference of two doubles can overflow; that of their halves cannot.
      if (std::isinf(to - from)) f = (iso / 2 - from / 2) / (to / 2 - from / 2);
    }
    return std::min(std::max(f, nearest), 1 - nearest);
  }

  bool is_midpoint() const { return midpoint_; }
  double nearest() const { return nearest_; }

  // A vertex on a sample that equals the iso-value would coincide with those on the sample's other
  // edges, and their triangles would have no area. So every vertex keeps a distance from the
  // samples that single precision resolves. This is that distance as a fraction of an edge.
  static double nearest_share(const Dims& dims, const LatticeToSpace& to_space);

 private:
  double iso_;
  bool midpoint_;
  double nearest_;
};

}  // namespace isomesh::mesh
