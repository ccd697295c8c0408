// Names that people give: of volumes, of labels.
#pragma once

#include <string>
#include <string_view>

namespace isomesh::volume {

// The text in Unicode's normalisation form C, so that names that look the same are the same. What
// is not UTF-8 stays as it is.
std::string normalized(std::string_view text);

}  // namespace isomesh::volume
