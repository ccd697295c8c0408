#include "server/codec/draco/fans.h"

#include <algorithm>

namespace isomesh::codec::edgebreaker {

void Fans::separate(const std::vector<std::vector<Corner>>& boundary, Connectivity& surface) {
  originals_.clear();
  on_boundary_.assign(surface.vertices / 64 + 1, 0);
  const auto mark = [&](Vertex vertex) {
    on_boundary_[vertex / 64] |= std::uint64_t{1} << (vertex % 64);
  };
  for (const std::vector<Corner>& corners : boundary) {
    for (const Corner corner : corners) {
      // Each open fan begins at a boundary edge.
      const Vertex vertex = surface.vertex(next(corner));
      if (on_boundary(vertex)) {
        copy_vertex(next(corner), surface);
      } else {
        mark(vertex);
      }
    }
  }
  surface.vertices += static_cast<Vertex>(originals_.size());
  on_boundary_.resize(surface.vertices / 64 + 1, 0);
  for (Vertex copy = surface.vertices - static_cast<Vertex>(originals_.size());
       copy < surface.vertices; ++copy) {
    mark(copy);
  }
}

// Duplicates the vertex for the fan that starts at this corner.
void Fans::copy_vertex(Corner first, Connectivity& surface) {
  const Vertex original = surface.vertex(first);
  if (originals_.empty()) {
    mesh::Triangle* const copy = triangles_.resize_for_overwrite(surface.faces);
    std::copy_n(surface.triangles, surface.faces, copy);
    surface.triangles = copy;
  }
  const auto fresh = static_cast<Vertex>(surface.vertices + originals_.size());
  originals_.push_back(original);
  for (Corner corner = first;;) {
    triangles_[face_of(corner)][index_of(corner)] = fresh;
    const Corner across = surface.opposite(next(corner));
    if (across == surface.none) break;
    corner = next(across);
  }
}

}  // namespace isomesh::codec::edgebreaker
