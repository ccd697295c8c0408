// What an NRRD header says about space (https://teem.sourceforge.net/nrrd/format.html): its fields
// space, space dimension, space directions, space origin, space units, spacings, axis mins, axis
// maxs, centers, kinds and units.
#pragma once

#include <cstdint>
#include <map>
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

// The field by which the program's own pair "key:=value" is kept.
std::string own_key(std::string_view key);

// What the sizes along a header's axes mean.
struct NrrdSizes {
  std::vector<std::uint64_t> all;      // as the header tells them
  std::vector<std::uint64_t> lattice;  // of the axes on which samples lie, at most three
  std::uint64_t volumes = 1;           // along the axis of another kind that has several
  std::string volume_kind;             // "list", "time", ...
  bool is_interleaved = false;         // that axis is the first, which runs fastest
};

// Axes of components, lists and time have kinds of their own and may stand anywhere; one of them,
// the first or the last, may have several volumes. Throws Error kUnusableVolume for components such
// as colours, and for several such axes.
NrrdSizes nrrd_sizes(const NrrdFields& fields, const std::vector<std::uint64_t>& sizes);

// The geometry of the first three of the lattice's axes, in LPS millimetres. RAS and LAS become
// LPS. Of the other spaces those that are right-handed are taken as they are, because nothing says
// how they lie in the patient, and left-handed ones are refused. A space of four dimensions without
// a name is what old versions of Slicer wrote segmentations in: RAS, with the place of the samples
// in Segment0_Extent; a note tells so. An axis without a spacing or a direction has samples as far
// apart as its min and max tell, or 1 mm, and a header without an origin begins at (0,0,0), as the
// readers of the format have it. Throws Error kUnusableVolume when the fields contradict each other
// or the format.
Geometry nrrd_geometry(const NrrdFields& fields, const std::vector<std::uint64_t>& sizes,
                       std::vector<Note>& notes);

}  // namespace isomesh::import
