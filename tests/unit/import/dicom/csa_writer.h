// The header of their own that Siemens' scanners write.
#pragma once

#include <string>
#include <utility>
#include <vector>

namespace isomesh::import::test {

using CsaFields = std::vector<std::pair<std::string, std::vector<std::string>>>;

// With `is_newer` in the layout that begins with "SV10".
std::string csa_header(const CsaFields& fields, bool is_newer = true);

}  // namespace isomesh::import::test
