// The paper's own way from samples to a smooth mesh, built only to compare with: "Laplacian mesh
// smoothing for tetrahedra based volume visualization", chapters 2 to 4.
//
// Every tetrahedron is looked at by itself, and its triangles carry three vertices each. Then each
// vertex is looked up in one of a number of sub-tables, which cut the range of x into equal parts
// and hold the unique vertices of their part sorted by x: small dynamic arrays that are searched by
// bisection, and shifted to insert. The neighbours of a vertex are found by searching a list of
// triangles. The paper searches the list of all triangles; here each sub-table also lists the
// triangles that touch it and only those are searched, or a mesh of the paper's size would take
// hours: with one sub-table the two are the same. The paper is silent about order; here all
// vertices of a pass move at once.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "server/mesh/mesh.h"
#include "tests/bench/samples.h"
#include "tests/bench/stages.h"

namespace isomesh::bench {

// Triangles with their vertices, nothing shared.
using Soup = std::vector<std::array<mesh::Vec3, 3>>;

// Cell by cell over the paper's Table 1, cells of odd i+j+k mirrored in the five-way split, without
// which the surface would have cracks. The triangles' winding is arbitrary. Vertices on a sample
// that equals the iso-value coincide, which the kernels avoid. Directions of the geometry are left
// out.
Soup extract_soup(const Samples& samples, const Surface& surface);

// The same triangles as soup.
Soup soup_of(std::span<const mesh::Vec3> positions, std::span<const mesh::Triangle> triangles);

// Result of the search for unique vertices.
struct IndexedMesh {
  struct Entry {
    mesh::Vec3 position;
    std::uint32_t vertex;
  };
  struct SubTable {
    std::vector<Entry> entries;             // sorted by x, unique
    std::vector<mesh::Triangle> triangles;  // those with a vertex in `entries`
  };

  std::vector<mesh::Vec3> vertices;       // in the order of their first appearance
  std::vector<mesh::Triangle> triangles;  // those that kept three different vertices
  std::vector<SubTable> sub_tables;

  // How many times the search for neighbours looks at a triangle.
  double search_steps() const;
};

IndexedMesh find_unique(const Soup& soup, std::size_t sub_tables);

// The neighbours of each vertex; none for a vertex on the boundary, which has a neighbour that it
// shares only one triangle with.
using NeighborLists = std::vector<std::vector<std::uint32_t>>;
NeighborLists find_neighbors(const IndexedMesh& mesh);

void smooth(const NeighborLists& neighbors, int passes, IndexedMesh& mesh);

}  // namespace isomesh::bench
