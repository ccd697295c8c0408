// Texts of DICOM -> UTF-8.
#pragma once

#include <string>
#include <string_view>

#include "server/import/dicom/elements/dataset.h"

namespace isomesh::import::dicom {

// Converts a text by the data set's Specific Character Set, its own or an inherited one (PS3.3,
// C.12.1.1.2). Values stay separated by backslashes. Invalid bytes and control characters become
// U+FFFD.
std::string utf8(const DataSet& data, Tag tag);

}  // namespace isomesh::import::dicom
