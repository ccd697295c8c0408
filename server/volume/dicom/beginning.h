// What tells a DICOM file, and where its elements begin.
#pragma once

#include <cstddef>
#include <optional>
#include <span>

namespace isomesh::volume::dicom {

// How many bytes stand before a file's first element: a preamble of 128 and "DICM" (PS3.10), or
// none in files that were stored before there was that, or by programs that leave it out. The
// latter are told by elements of the groups 0002 and 0008 in rising order, up to a SOP class or
// transfer syntax of the standard. Empty when `head`, the first bytes of a file, is neither. Thread
// safe.
std::optional<std::size_t> find_beginning(std::span<const std::byte> head);

}  // namespace isomesh::volume::dicom
