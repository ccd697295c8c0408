// The part of a DICOM file before its data set (PS3.10, 7.1).
#pragma once

#include <string>
#include <string_view>

namespace isomesh::dicom {

// Preamble, prefix and file meta information. Pure function.
std::string file_head(std::string_view sop_class, std::string_view instance,
                      std::string_view transfer_syntax);

}  // namespace isomesh::dicom
