// What an NRRD header says about space (https://teem.sourceforge.net/nrrd/format.html): its fields
// space, space dimension, space directions, space origin, space units, spacings, axis mins, axis
// maxs, centers, kinds and units.
#pragma once

#include <cstdint>
#include <map>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "proto/types.h"

namespace isomesh::import {

// A header's fields. Names are in lower case and without spaces, because "data file" and
// "datafile" are the same field.
using NrrdFields = std::map<std::string, std::string, std::less<>>;

// Empty for a field that the header does not have.
std::string_view value_of(const NrrdFields& fields, std::string_view name);

// The sizes along the axes on which samples lie: all `sizes` but those along which the components
// of one sample lie. Those have kinds of their own, may stand anywhere and must be of size 1.
// Throws Error kUnusableVolume for components and for time.
std::vector<std::uint64_t> lattice_sizes(const NrrdFields& fields,
                                         std::span<const std::uint64_t> sizes);

// The geometry of the first three of those axes, in LPS millimetres. RAS and LAS become LPS. Of the
// other spaces those that are right-handed are taken as they are, because nothing says how they lie
// in the patient, and left-handed ones are refused. An axis without a spacing or a direction has
// samples 1 mm apart, and a header without an origin begins at (0,0,0), as the readers of the
// format have it. Throws Error kUnusableVolume when the fields contradict each other or the format.
Geometry nrrd_geometry(const NrrdFields& fields, std::span<const std::uint64_t> sizes);

}  // namespace isomesh::import
