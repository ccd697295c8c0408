// Texts in XML. Pure functions.
#pragma once

#include <string>
#include <string_view>

namespace isomesh {

// As an attribute's value or an element's content. What XML cannot hold becomes U+FFFD.
std::string xml_escaped(std::string_view text);

}  // namespace isomesh
