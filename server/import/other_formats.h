// Files of other programs that no reader knows, so that an error can name them.
#pragma once

#include <optional>
#include <string_view>

namespace isomesh::import {

// What the file is, with an article: "an Imaris file". Empty for an unknown beginning.
std::optional<std::string_view> name_of_other_format(std::string_view head);

}  // namespace isomesh::import
