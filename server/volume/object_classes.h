#pragma once

#include <optional>
#include <string_view>

namespace isomesh::volume {

// A description of that class, such as "a report"; empty if its objects may be images.
std::optional<std::string_view> kind_without_images(std::string_view sop_class);

}  // namespace isomesh::volume
