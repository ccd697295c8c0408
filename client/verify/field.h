// The volume, and the surface S that a mesh is held against.
#pragma once

#include <filesystem>
#include <vector>

#include "client/verify/surface.h"
#include "proto/parameters.h"
#include "server/import/message/import_message.h"

namespace isomesh::verify {

using Sample = std::array<std::int64_t, 3>;  // indices along the axes of a volume

struct Field {
  Sample dims = {0, 0, 0};
  std::vector<double> values;  // x fastest
  Vec origin = {0, 0, 0};
  std::array<Vec, 3> steps = {};  // from a sample to the next along i, j and k

  Vec place(const Vec& index) const {
    return origin + index[0] * steps[0] + index[1] * steps[1] + index[2] * steps[2];
  }
  Vec index_of(const Vec& place) const;

  // The samples of a box of indices. Those outside of the volume are infinitely low.
  Field part(const Sample& begin, const Sample& end) const;

  // The samples within the extents of a box along the volume's axes. Throws Error
  // kInvalidParameter if there are none.
  Field cropped(const std::array<Vec, 2>& box) const;
};

// Reads a file, or a folder, by the program isomesh-import. Throws Error, also if that is missing.
Field read_field(const std::filesystem::path& volume, const import::ImportOptions& options);

struct Cut {
  double iso = 0;
  int tetrahedra = 6;     // of a cell: 6 (Kuhn's split) or 5
  bool close = false;     // the field is infinitely low outside of the volume
  bool midpoint = false;  // only the sign of the field counts
  bool fill = false;      // cavities are filled
};

// For a surface around lower values: makes the field and the iso-value negative, so that what was
// below it is inside.
void turn_over(Cut& cut, Field& field);

// Raises the samples of cavities, and of what floats in them, so that the zero set has no walls
// there. A cavity is below the iso-value, and no path along edges of tetrahedra leads from it to
// the border of the volume.
void fill_cavities(const Cut& cut, Field& field);

// The set where the field is `iso`, linear in each tetrahedron. Triangles face lower values; some
// have no area, where a sample has that value or the surface is closed. Points are in the order of
// the samples that own their edges, x fastest, and then of the directions.
Surface zero_set(const Field& field, const Cut& cut);

// Leaves other components out, as a job does: keeps those of the points nearest to
// `filter.nearest_to`, if there are any; of these, those of at least `filter.min_triangles`; of
// these, the `filter.keep` with the most triangles, of equal ones those of the first points.
void keep_components(const ComponentFilter& filter, Surface& surface);

}  // namespace isomesh::verify
