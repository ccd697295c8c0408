// DICOM objects and headers of every kind that has a reader of its own.
#pragma once

#include <string>
#include <vector>

namespace isomesh::fuzz {

std::vector<std::string> dicom_objects();
std::vector<std::string> csa_headers();
std::vector<std::string> structure_sets();
std::vector<std::string> siemens_protocols();

}  // namespace isomesh::fuzz
