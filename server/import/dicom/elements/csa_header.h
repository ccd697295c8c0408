// Siemens' private header in (0029,1010): named fields of texts.
#pragma once

#include <map>
#include <string>
#include <string_view>
#include <vector>

namespace isomesh::import::dicom {

// The values of each field, as texts without padding; empty ones are omitted. Both known layouts
// are read: the older one, and the one that begins with "SV10".
using CsaHeader = std::map<std::string, std::vector<std::string>, std::less<>>;

// Throws Error kUnusableVolume if a count or length exceeds `bytes`. Time and memory are
// proportional to `bytes`. Thread safe.
CsaHeader parse_csa_header(std::string_view bytes);

// The numbers of a field. Empty if it is missing or not a list of finite numbers.
std::vector<double> csa_numbers(const CsaHeader& header, std::string_view field);

}  // namespace isomesh::import::dicom
