// Classes of DICOM objects that lie beside images and hold none.
#pragma once

#include <optional>
#include <string_view>

namespace isomesh::volume {

// What objects of that class are, such as "a report"; empty when they may be images.
std::optional<std::string_view> kind_without_images(std::string_view sop_class);

}  // namespace isomesh::volume
