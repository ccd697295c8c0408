// The volume, and the surface S that a mesh is held against.
#pragma once

#include <filesystem>
#include <optional>
#include <vector>

#include "client/verify/surface.h"
#include "proto/types.h"
#include "server/import/message/import_message.h"

namespace isomesh::verify {

struct Field {
  std::array<std::int64_t, 3> dims = {0, 0, 0};
  std::vector<double> samples;  // x fastest
  Vec origin = {0, 0, 0};
  std::array<Vec, 3> steps = {};  // from a sample to the next along i, j and k

  Vec place(const Vec& index) const {
    return origin + index[0] * steps[0] + index[1] * steps[1] + index[2] * steps[2];
  }
  Vec index_of(const Vec& place) const;

  // Keeps the samples within the extents of the box along the volume's axes.
  void crop(const std::array<Vec, 2>& box);
};

// Reads a file, or a folder, by the program isomesh-import. Throws what that says, or Error
// kInvalidParameter if the program is missing.
Field read_field(const std::filesystem::path& volume, const import::ImportOptions& options);

struct Cut {
  double iso = 0;
  int tetrahedra = 6;     // of a cell: 6 (Kuhn's split) or 5
  bool close = false;     // the field is infinitely low outside the volume
  bool midpoint = false;  // only the sign of the field counts
};

// The set where field - iso is zero, linear in each tetrahedron. Triangles face lower values; some
// have no area, where a sample equals the iso-value or lies on a cap.
Surface zero_set(const Field& field, const Cut& cut);

}  // namespace isomesh::verify
