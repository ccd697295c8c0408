// Compresses bytes for test files.
#pragma once

#include <string>
#include <string_view>

namespace isomesh::test {

// One DEFLATE stream in gzip's wrapping, in zlib's, and raw. Throw std::runtime_error if zlib has
// no memory.
std::string gzip(std::string_view bytes);
std::string zlib(std::string_view bytes);
std::string raw_deflate(std::string_view bytes);

std::string bzip2(std::string_view bytes);

}  // namespace isomesh::test
