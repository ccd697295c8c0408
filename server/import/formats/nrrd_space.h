// The spatial fields of an NRRD header (https://teem.sourceforge.net/nrrd/format.html): space,
// space dimension, space directions, space origin, space units, spacings, axis mins, axis maxs,
// centers, kinds and units.
#pragma once

#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

#include "proto/types.h"
#include "server/import/source/header_fields.h"
#include "server/import/source/names.h"

namespace isomesh::import {

// A header's fields. Names are in lower case without spaces: "data file" and "datafile" are the
// same field.
using NrrdFields = HeaderTexts;

// The name under which a private pair "key:=value" is stored.
std::string own_key(std::string_view key);

// The meaning of the sizes of a header's axes.
struct NrrdSizes {
  std::vector<std::uint64_t> all;      // in the header's order
  std::vector<std::uint64_t> lattice;  // of the axes of samples, at most three
  std::uint64_t volumes = 1;           // the size of another axis with several elements
  std::string volume_kind;             // "list", "time", ...
  std::uint64_t run = 1;               // samples of a volume that lie together
};

// Axes of components, lists and time have their own kinds and may be anywhere; one of them may have
// several volumes. Throws Error kUnusableVolume for components such as
// colours, and for several such axes.
NrrdSizes nrrd_sizes(const NrrdFields& fields, const std::vector<std::uint64_t>& sizes);

// The geometry of the lattice's first three axes, in LPS, in the header's unit. Converts RAS and
// LAS to LPS. Other right-handed spaces and unnamed ones are used unchanged, with a note, because
// their relation to the patient is unknown; a left-handed one must be accepted by the options and
// is noted. An unnamed space of four dimensions is ITK's, LPS, or that of a segmentation of an old
// Slicer version: RAS, with the samples' position in Segment0_Extent. A note tells which; the
// options must accept it if the header does not tell. An axis without a spacing or a direction gets
// it from its min and max, otherwise 1 mm. Without an origin the first sample is at (0,0,0). Both
// are as in the format's other readers. Throws Error kUnusableVolume if the fields contradict each
// other or the format.
Geometry nrrd_geometry(const NrrdFields& fields, const std::vector<std::uint64_t>& sizes,
                       const ImportOptions& options, std::vector<Note>& notes);

// The unit of the geometry; empty if the header has none. Throws Error kUnusableVolume if the axes
// have different ones.
std::string nrrd_unit(const NrrdFields& fields, const std::vector<std::uint64_t>& sizes);

// False if no axis of the lattice has a spacing, a direction, or a min and a max.
bool nrrd_has_spacing(const NrrdFields& fields, const std::vector<std::uint64_t>& sizes);

}  // namespace isomesh::import
