// The XML of VTK's image files
// (https://docs.vtk.org/en/latest/design_documents/VTKFileFormats.html).
#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

#include "base/files.h"
#include "server/import/source/gzip.h"
#include "server/import/source/header_fields.h"

namespace isomesh::import {

struct VtiArray {
  HeaderTexts attributes;
  CompressedRange text;  // the byte range between its tags
};

// The parts of the document that a volume needs.
struct VtiDocument {
  HeaderTexts file;
  HeaderTexts image;
  HeaderTexts piece;
  HeaderTexts point_data;
  HeaderTexts cell_data;
  std::size_t pieces = 0;
  std::vector<VtiArray> point_arrays;
  std::vector<VtiArray> cell_arrays;
  HeaderTexts appended;
  std::uint64_t appended_at = 0;  // file offset of its data; 0: none
};

// Reads the document up to its appended data, which is not XML. Throws Error kUnusableVolume if it
// is not well-formed, not an image, or uses XML features that VTK does not write.
VtiDocument read_vti_document(const InputFile& file);

// Reads the image's attributes, which precede anything large. Throws as read_vti_document, also if
// they are missing because the file is truncated.
HeaderTexts read_vti_image(const InputFile& beginning);

}  // namespace isomesh::import
