#pragma once

#include <string>
#include <string_view>

namespace isomesh::dicom {

// "2.25." and the decimal form of a version 5 UUID (RFC 9562) in isomesh's own constant namespace,
// so that a name always has the same UID on every machine (PS3.5, B.2). Thread safe. Throws Error
// kInternal if the system's library has no SHA-1.
std::string name_based_uid(std::string_view name);

}  // namespace isomesh::dicom
