// Unpacks a DICOMweb response: multipart/related (RFC 2387, PS3.18 8.6.1.2).
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

// The parameter `boundary` of a Content-Type. Throws Error kUnusableVolume if the PACS sends other
// forms, or none that can be read (RFC 2046, 5.1.1), and kSeriesIncomplete if the response is none
// of a PACS, such as a page of HTML: the next one may be.
std::string boundary_of(std::string_view content_type);

// True if the response is one DICOM file, without multipart/related.
bool is_single_dicom(std::string_view content_type);

// Writes each part's content to a file in `folder`, which must exist and be empty, and returns the
// files in order. Ignores the parts' headers. Lines may end with LF alone. Throws Error
// kSeriesIncomplete if the closing boundary is missing, kTooLarge beyond the limits.
std::vector<std::filesystem::path> unpack_multipart(const std::filesystem::path& file,
                                                    const std::string& boundary,
                                                    const std::filesystem::path& folder,
                                                    const MultipartLimits& limits);

}  // namespace isomesh::import
