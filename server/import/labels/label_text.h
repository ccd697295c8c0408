// Tables of labels, as programs write them beside a label volume or into its header.
#pragma once

#include <cstdint>
#include <string_view>
#include <vector>

#include "proto/types.h"

namespace isomesh::import {

// Parses a table. Each line has a label's number, its name, and possibly its colour:
//   1 Left-Thalamus 0 118 14 0              FreeSurfer's and 3D Slicer's colour tables
//   1 255 0 0 1 1 1 "Left thalamus"         ITK-SNAP's label descriptions
//   1 0.2 0.4 0.9 Left thalamus             FSLeyes' lookup tables
//   1 Left thalamus
// or the table has named columns, separated by tabs: BIDS's "index", "name" and maybe "color"; or
// it is a JSON document. Lines that begin with "#", "%" or "//" are comments.
// Returns none unless every other line is such an entry, and for more than Volume::kMostLabels.
// Unordered. Never throws because of the text.
std::vector<LabelEntry> labels_of_text(std::string_view text);

// The labels of one of the file's volumes: Caret's LabelTable in the VolumeInformation of that
// index, or AFNI's attribute VALUE_LABEL_DTABLE. Empty if the document has neither or is not
// well-formed; at most one more than Volume::kMostLabels. Unordered.
std::vector<LabelEntry> labels_of_xml(std::string_view text, std::uint64_t volume);

}  // namespace isomesh::import
