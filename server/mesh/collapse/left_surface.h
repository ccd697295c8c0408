// A surface as collapses leave it, numbered anew, with the walls at each vertex; private to this
// folder.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "server/mesh/collapse/history.h"
#include "server/mesh/context.h"
#include "server/mesh/labels/separate.h"
#include "server/mesh/mesh.h"

namespace isomesh::mesh::collapse {

// A slot is a vertex in one of its walls. Takes 8 bytes a vertex and 4 a triangle of the mesh, and
// some 40 of each triangle that is left. Immutable, so safe to read from several threads.
class LeftSurface {
 public:
  static constexpr std::uint32_t kNone = ~std::uint32_t{0};

  // By numbers of the vertices that are left.
  struct LeftTriangle {
    Triangle corners;
    Triangle slots;
  };

  // `sides`: of the mesh's triangles, empty if all are of one wall. Throws Error kCancelled,
  // and kTooLarge if 32 bits cannot number the corners.
  LeftSurface(const Mesh& mesh, std::span<const WallSides> sides, const History& history,
              const Context& context);

  std::size_t walls() const { return walls_.size(); }
  // The wall of a triangle of the mesh, by number.
  std::uint32_t wall_of(std::size_t triangle) const {
    return wall_of_.empty() ? 0 : wall_of_[triangle];
  }

  std::span<const LeftTriangle> triangles() const { return triangles_; }
  // The mesh's vertices that are left, ascending.
  std::span<const std::uint32_t> vertices() const { return left_; }
  // The vertex that a vertex of the mesh has become.
  std::uint32_t kept(std::uint32_t vertex) const { return kept_[vertex]; }

  std::size_t slots() const { return slot_walls_.size(); }
  std::uint32_t first_slot(std::size_t number) const { return first_slot_[number]; }
  std::uint32_t slot_count(std::size_t number) const {
    return first_slot_[number + 1] - first_slot_[number];
  }
  std::uint32_t wall_of_slot(std::size_t slot) const { return slot_walls_[slot]; }
  // The corners that a slot is, ascending: 3 * triangle + corner.
  std::span<const std::uint32_t> corners_at(std::size_t slot) const {
    return std::span(corners_).subspan(first_corner_[slot],
                                       first_corner_[slot + 1] - first_corner_[slot]);
  }
  // The slot in a wall of what a vertex of the mesh has become; kNone if it has none there.
  std::uint32_t slot_of_kept(std::uint32_t vertex, std::uint32_t wall) const;

 private:
  void find_walls(std::span<const WallSides> sides, const Context& context);
  void find_left(const Mesh& mesh, const History& history, const Context& context);
  void make_slots();
  void find_corners();
  std::uint32_t slot_of(std::uint32_t number, std::uint32_t wall) const;

  std::vector<WallSides> walls_;        // ascending
  std::vector<std::uint32_t> wall_of_;  // of each triangle of the mesh; empty: all are of one
  std::vector<std::uint32_t> kept_;     // of each vertex of the mesh
  std::vector<std::uint32_t> number_;   // of it among those that are left
  std::vector<std::uint32_t> left_;
  std::vector<LeftTriangle> triangles_;
  std::vector<std::uint32_t> first_slot_;  // of each vertex that is left, and the end
  std::vector<std::uint32_t> slot_walls_;
  std::vector<std::uint32_t> first_corner_;  // of each slot, and the end
  std::vector<std::uint32_t> corners_;
};

}  // namespace isomesh::mesh::collapse
