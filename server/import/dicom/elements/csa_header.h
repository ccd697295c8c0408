// Siemens' private headers: in (0029,1010) named fields of texts, and in (0029,1020) lines of text
// with the protocol of the scanner.
#pragma once

#include <map>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "server/import/source/names.h"

namespace isomesh::import::dicom {

// The values of each field, as texts without padding; empty ones are omitted. Both known layouts
// are read: the older one, and the one that begins with "SV10".
using CsaHeader = std::map<std::string, std::vector<std::string>, std::less<>>;

// Throws Error kUnusableVolume if a count or length exceeds `bytes`. Time and memory are
// proportional to `bytes`. Thread safe.
CsaHeader parse_csa_header(std::string_view bytes);

// The numbers of a field. Empty if it is missing or not a list of finite numbers.
std::vector<double> csa_numbers(const CsaHeader& header, std::string_view field);

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
