// Recognises DICOM files and finds their first element.
#pragma once

#include <cstddef>
#include <optional>
#include <span>

namespace isomesh::import::dicom {

// The number of bytes before a file's first element. Most files have a preamble of 128 bytes and
// "DICM" (PS3.10). Older files, and those of some programs, have none. They are recognised by
// elements of the groups 0002 and 0008 in ascending order, up to a SOP class or transfer syntax of
// the standard. Empty if `head`, a file's first bytes, is neither. Thread safe.
std::optional<std::size_t> find_beginning(std::span<const std::byte> head);

}  // namespace isomesh::import::dicom
