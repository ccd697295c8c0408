// Tells whether a file is DICOM, and where its elements begin.
#pragma once

#include <cstddef>
#include <optional>
#include <span>

namespace isomesh::import::dicom {

// How many bytes come before a file's first element. Most files have a preamble of 128 bytes and
// "DICM" (PS3.10). Older files, and some programs' files, have none; they are known by elements of
// the groups 0002 and 0008 in rising order, up to a SOP class or transfer syntax of the standard.
// Empty when `head`, the first bytes of a file, is neither. Thread safe.
std::optional<std::size_t> find_beginning(std::span<const std::byte> head);

}  // namespace isomesh::import::dicom
