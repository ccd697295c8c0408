#pragma once

#include <map>
#include <string>

namespace isomesh::test {

// The names and bytes in a ZIP, as libarchive reads them.
std::map<std::string, std::string> unzipped(const std::string& bytes);

}  // namespace isomesh::test
