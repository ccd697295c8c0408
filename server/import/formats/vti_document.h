// The XML of VTK's image files
// (https://docs.vtk.org/en/latest/design_documents/VTKFileFormats.html).
#pragma once

#include <cstddef>
#include <cstdint>
#include <map>
#include <string>
#include <string_view>
#include <vector>

#include "base/files.h"
#include "server/import/source/gzip.h"

namespace isomesh::import {

using VtiAttributes = std::map<std::string, std::string, std::less<>>;

// Returns an empty text if missing.
std::string_view attribute_of(const VtiAttributes& attributes, std::string_view name);

struct VtiArray {
  VtiAttributes attributes;
  CompressedRange text;  // the byte range between its tags
};

// The parts of the document that a volume needs.
struct VtiDocument {
  VtiAttributes file;
  VtiAttributes image;
  VtiAttributes piece;
  VtiAttributes point_data;
  VtiAttributes cell_data;
  std::size_t pieces = 0;
  std::vector<VtiArray> point_arrays;
  std::vector<VtiArray> cell_arrays;
  VtiAttributes appended;
  std::uint64_t appended_at = 0;  // file offset of its data; 0: none
};

// Reads the document up to its appended data, which is not XML. Throws Error kUnusableVolume if it
// is not well-formed, not an image, or uses XML features that VTK does not write.
VtiDocument read_vti_document(const InputFile& file);

// Reads the image's attributes, which precede anything large. Throws as read_vti_document, also if
// they are missing because the file is truncated.
VtiAttributes read_vti_image(const InputFile& beginning);

}  // namespace isomesh::import
