// Texts of DICOM -> UTF-8.
#pragma once

#include <string>
#include <string_view>

#include "server/import/dicom/elements/dataset.h"

namespace isomesh::import::dicom {

// A text by the data set's Specific Character Set (PS3.3, C.12.1.1.2), several parts separated by
// backslashes as they are stored. What cannot be read, and control characters, are replaced by
// U+FFFD.
std::string utf8(const DataSet& data, Tag tag);

// Loads what converts each of them, for as long as the process lives. To be called before the
// process gives up opening files: without it names that are not ASCII or UTF-8 would be lost.
void load_character_sets();

}  // namespace isomesh::import::dicom
