// The protocol of a Siemens scanner: lines of text in its private header (0029,1020).
#pragma once

#include <optional>
#include <string_view>

#include "server/import/source/names.h"

namespace isomesh::import::dicom {

// The slices of the protocol, in its order. It may be the reverse of the order in an image.
struct ProtocolSlices {
  std::uint32_t count = 0;
  Vector3 first = {};  // the centre of the first slice, in mm
  Vector3 last = {};
  Vector3 normal = {};  // of the first slice; as stored
};

// Reads the slices between the lines "### ASCCONV BEGIN" and "### ASCCONV END". The scanner omits
// numbers that are 0. Empty if there is no such text, or if it has no number of slices, or one
// beyond 4096, or a number that is not finite. Time is proportional to `header`. Thread safe.
std::optional<ProtocolSlices> protocol_slices(std::string_view header);

}  // namespace isomesh::import::dicom
