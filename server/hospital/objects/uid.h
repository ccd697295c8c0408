// UIDs that follow from what they name.
#pragma once

#include <string>
#include <string_view>

namespace isomesh::dicom {

// "2.25." and, as a decimal number, the UUID of version 5 (RFC 9562) of that name in a namespace of
// isomesh's own, which never changes: the same name has the same UID on every machine, for ever
// (PS3.5, B.2). Thread safe. Throws Error kInternal when the system's library has no SHA-1.
std::string name_based_uid(std::string_view name);

}  // namespace isomesh::dicom
