#pragma once

#include <string>
#include <string_view>

namespace isomesh::http {

// The value of a parameter such as the name in `attachment; filename="a b.nii"` (RFC 9110, 5.6.6),
// without quotes; empty if missing. Names of parameters are case-insensitive.
std::string header_parameter(std::string_view header, std::string_view name);

// A word or a quoted string, without the quotes.
std::string unquoted(std::string_view text);

}  // namespace isomesh::http
