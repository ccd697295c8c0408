// Unpacks what a DICOMweb server sends: multipart/related (RFC 2387, PS3.18 8.6.1.2).
#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <string>
#include <string_view>
#include <vector>

namespace isomesh::import {

struct MultipartLimits {
  std::uint64_t max_bytes = 0;  // of all parts
  std::size_t max_parts = 0;
};

// The parameter `boundary` of a Content-Type. Throws Error kSeriesIncomplete where there is none
// that a boundary can be (RFC 2046, 5.1.1): what came is no answer of that kind.
std::string boundary_of(std::string_view content_type);

// Writes the content of each part to a file of its own in `folder`, which exists and is empty, and
// returns those in order. Headers of parts are passed over. Throws Error kSeriesIncomplete when the
// closing boundary does not come, kTooLarge beyond the limits.
std::vector<std::filesystem::path> unpack_multipart(const std::filesystem::path& file,
                                                    const std::string& boundary,
                                                    const std::filesystem::path& folder,
                                                    const MultipartLimits& limits);

}  // namespace isomesh::import
