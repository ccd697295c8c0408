// Escapes text for XML. Pure functions.
#pragma once

#include <string>
#include <string_view>

namespace isomesh {

// For an attribute's value or an element's content. Characters that XML cannot hold become U+FFFD.
std::string xml_escaped(std::string_view text);

}  // namespace isomesh
