#pragma once

#include <string>
#include <string_view>

namespace isomesh::volume {

// Converts a text to Unicode normalisation form C, so that names that look equal are equal. Invalid
// UTF-8 stays unchanged.
std::string normalized(std::string_view text);

}  // namespace isomesh::volume
