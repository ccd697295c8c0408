// Bytes as compressed files hold them.
#pragma once

#include <string>
#include <string_view>

namespace isomesh::test {

// One DEFLATE stream within gzip's header and checksum, within zlib's, and bare. Throw
// std::runtime_error when zlib has no memory.
std::string gzip(std::string_view bytes);
std::string zlib(std::string_view bytes);
std::string raw_deflate(std::string_view bytes);

// One bzip2 stream.
std::string bzip2(std::string_view bytes);

}  // namespace isomesh::test
