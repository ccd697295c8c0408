// The header of their own that Siemens' scanners write into (0029,1010): named fields of texts.
#pragma once

#include <map>
#include <string>
#include <string_view>
#include <vector>

namespace isomesh::import::dicom {

// The fields by name, each with its values, which are texts without padding; empty ones are left
// out. Both known layouts are read: the one that begins with "SV10" and the older one.
using CsaHeader = std::map<std::string, std::vector<std::string>, std::less<>>;

// Throws Error kUnusableVolume when a count or length in `bytes` reaches beyond them. Takes time
// and memory in proportion to `bytes`. Thread safe.
CsaHeader parse_csa_header(std::string_view bytes);

// The numbers of a field. Empty when it is not there, or is no list of finite numbers.
std::vector<double> csa_numbers(const CsaHeader& header, std::string_view field);

}  // namespace isomesh::import::dicom
