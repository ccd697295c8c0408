// What stands before the data set in a DICOM file (PS3.10, 7.1).
#pragma once

#include <string>
#include <string_view>

namespace isomesh::dicom {

// Preamble, prefix and meta information of a file that isomesh writes. Pure function.
std::string file_head(std::string_view sop_class, std::string_view instance,
                      std::string_view transfer_syntax);

}  // namespace isomesh::dicom
