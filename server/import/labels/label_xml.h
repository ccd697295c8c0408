#pragma once

#include <cstdint>
#include <string_view>
#include <vector>

#include "proto/types.h"

namespace isomesh::import {

// The labels of one of the file's volumes: Caret's LabelTable in the VolumeInformation of that
// index, or AFNI's attribute VALUE_LABEL_DTABLE. Empty if the document has neither or is not
// well-formed; at most one more than Volume::kMostLabels. Unordered.
std::vector<LabelEntry> labels_of_xml(std::string_view text, std::uint64_t volume);

}  // namespace isomesh::import
