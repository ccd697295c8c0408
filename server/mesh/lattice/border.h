// Vertices of a closed surface on the border of the volume; private to the kernels.
//
// A surface is closed by one more layer of samples around the volume, phantoms that are outside. An
// edge from an inside sample `a` to a phantom is crossed, and its vertex belongs to the cap. A
// phantom has no value, and caps lie on the border. So the phantom stands for the border sample `b`
// next to it, and the vertex lies between `a` and `b`:
//  * at `a` where they are the same;
//  * half-way where `b` is inside. The cap is then the middle section of the prisms between two
//    triangulations of the border, and every triangle of it has an area;
//  * half-way to the surface where `b` is outside, so that cap and surface meet in the surface's
//    vertices alone.
// With five tetrahedra, a cap's triangle has one vertex on each of two edges from `a` and may have
// one on the diagonal between them, where the surface crosses it. So that the triangle does not
// turn over, its vertices on the edges are no farther from `a`, as shares. At the edges and corners
// of the volume's box several vertices would coincide: those to the phantoms beyond one face,
// beyond the other and beyond both. One stays, so the box is exact. The others give way along the
// faces: by a fifth of the spacing if all around is inside, and by the least that single precision
// resolves where the surface may be near.
#pragma once

#include <array>
#include <cstdint>

#include "server/mesh/lattice/placement.h"
#include "server/mesh/lattice/tetrahedra.h"
#include "server/mesh/mesh.h"

namespace isomesh::mesh {

// The share of an edge in a face of the box that a closed surface keeps from samples, from that of
// other edges, Placement::nearest().
double nearest_on_border(double nearest);

// In lattice indices; phantoms are at -1 and at the number of samples.
using BorderSample = std::array<std::int64_t, 3>;

// A vertex near the border of the volume.
struct BorderVertex {
  Vec3 position = {0, 0, 0};
  bool on_border = false;  // its edge lies in a face of the volume's box or leads to a phantom
};

// Immutable, so safe to read from several threads. Instantiated for the eight types of SampleType.
template <class T>
class BorderPlacement {
 public:
  // `interior` places what is not on the border. `lattice` must outlive this.
  BorderPlacement(const Lattice<T>& lattice, const ExtractOptions& options,
                  const Threshold<T>& threshold, const Placement& interior);

  // The vertex on a crossed edge between corners of the cell whose corner 0 is `cell`.
  BorderVertex place(const BorderSample& cell, const EdgeEnds& ends) const;

 private:
  using Sample = BorderSample;
  using Offset = std::array<std::int64_t, 3>;
  using Point = std::array<double, 3>;

  bool is_phantom(const Sample& sample) const;
  bool is_inside(const Sample& sample) const;
  T value(const Sample& sample) const;
  std::int64_t outward(const Sample& sample, std::size_t axis) const;
  bool share_a_face(const Sample& a, const Sample& b) const;
  bool all_around_is_inside(const Sample& sample) const;
  double nearest_diagonal_share(const Sample& inside, const Sample& neighbor) const;
  bool has_edge(const Sample& from, const Offset& offset) const;
  bool gives_way(const Sample& inside, const Offset& to_phantom, std::size_t axis) const;
  Point cap_point(const Sample& inside, const Sample& phantom) const;

  const Lattice<T>& lattice_;
  const Sample dims_;
  const bool five_;
  const Threshold<T> threshold_;
  const Placement interior_;
  const double least_way_;  // the least that a vertex gives way, as a share of the spacing
  const Placement contour_;
};

}  // namespace isomesh::mesh
