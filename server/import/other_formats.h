// Names of formats that cannot be read, for messages.
#pragma once

#include <optional>
#include <string_view>

namespace isomesh::import {

// "a CZI file of Zeiss" by the plain beginning of a file (kSniffBytes); empty if it is unknown.
std::optional<std::string_view> name_of_other_format(std::string_view head);

}  // namespace isomesh::import
