// Tables of labels in XML.
#pragma once

#include <cstdint>
#include <string_view>
#include <vector>

#include "proto/types.h"

namespace isomesh::import {

// The labels that a document has for one of its file's volumes: Caret's LabelTable in the
// VolumeInformation of that index, or AFNI's attribute VALUE_LABEL_DTABLE. None where it has
// neither or is no well-formed XML; at most one more than Volume::kMostLabels. Not in order.
std::vector<LabelEntry> labels_of_xml(std::string_view text, std::uint64_t volume);

}  // namespace isomesh::import
