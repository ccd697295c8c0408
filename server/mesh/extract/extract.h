// Iso-surface extraction by marching tetrahedra.
//
// A cell of eight samples is split into five or six tetrahedra; in each the surface is the plane
// patch that linear interpolation puts there (B. A. Payne, A. W. Toga, "Surface mapping brain
// function on 3D models", IEEE Computer Graphics and Applications 10(5), 1990; A. Doi, A. Koide,
// "An efficient method of triangulating equi-valued surfaces by using tetrahedral cells", IEICE
// Transactions E74(1), 1991, whose Table 1 has both splits). The six-way split is Kuhn's (H. W.
// Kuhn, "Some combinatorial lemmas in topology", IBM Journal of Research and Development 4(5),
// 1960), which tiles by translation; of the five-way split every cell with odd i+j+k is mirrored,
// or the diagonals of shared faces would cross.
//
// On the body-centred lattice the centres of the cells are samples, too, each the mean of eight
// (lattice/bcc_faces.h). Its tetrahedra lie around the faces of the cells, four around each; a
// tetrahedron between the layers k and k+1 belongs to layer k. So a vertex of layer k may lie up to
// half a step beyond plane k+1: on the edge between two centres.
//
// A surface that is regularised has a third as many triangles: crossings around a sample become one
// vertex at their mean, wherever that keeps the topology (links.h). Those on edges in the border of
// the volume stay, and so does every boundary.
//
// Three passes: count_surface (1) counts the vertices and triangles of each layer and (2) sums the
// counts up, so that every layer knows its place; SurfaceWindows (windows.h) writes (3) every
// vertex and triangle there. Nothing is searched, hashed or merged: a vertex is named by the sample
// that owns its edge and the edge's direction, and its index is a running count.
//
// A surface that is to be closed is marched on around the volume, as if one more layer of samples
// beyond each face were outside; those samples are nowhere in memory. Its caps lie on the border of
// the volume (border.h). The rest is what it is when it stays open, but for vertices in the faces
// of the volume's box that are next to a sample of about the iso-value.
#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include "server/mesh/context.h"
#include "server/mesh/extract/clusters.h"
#include "server/mesh/extract/crossed_rows.h"
#include "server/mesh/lattice/lattice.h"
#include "server/mesh/lattice/placement.h"
#include "server/mesh/mesh.h"

namespace isomesh::mesh {

// How large the surface is, layer by layer; layers + 1 running sums each, as in Mesh. There are as
// many layers as the lattice has planes, and two more when the surface is closed.
struct SurfaceCount {
  std::vector<std::uint64_t> layer_vertices = {0};
  std::vector<std::uint64_t> layer_triangles = {0};
  std::vector<ClusterLayer> clusters;  // of each layer; empty of a surface that is not regularised
  std::vector<CrossedRows> crossed = {};  // of each layer

  std::uint64_t vertices() const { return layer_vertices.back(); }
  std::uint64_t triangles() const { return layer_triangles.back(); }
};

// The sizes from which memory use is estimated.
struct SurfaceSize {
  std::uint64_t triangles = 0;
  std::uint64_t vertices = 0;
  std::uint64_t layers = 0;
  // In vertices: the largest of one layer, of two that follow each other, and so on.
  std::array<std::uint64_t, 33> largest_runs = {};

  std::uint64_t largest_layer() const { return largest_runs.front(); }
  // At least the vertices of any so many layers that follow each other.
  std::uint64_t most_vertices(std::uint64_t in_layers) const;
};

SurfaceSize size_of(const SurfaceCount& count);

// Counts without writing; exact. A lattice without cells, or an iso-value outside the samples'
// range, has an empty surface. Thread safe. Throws Error kCancelled.
template <class T>
SurfaceCount count_surface(const Lattice<T>& lattice, const ExtractOptions& options,
                           const Context& context);

}  // namespace isomesh::mesh
