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

// Empty where there is none.
std::string_view attribute_of(const VtiAttributes& attributes, std::string_view name);

// An array of the point data.
struct VtiArray {
  VtiAttributes attributes;
  CompressedRange text;  // the file's bytes between its tags
};

// The parts of the XML that a volume needs.
struct VtiDocument {
  VtiAttributes file;
  VtiAttributes image;
  VtiAttributes piece;
  VtiAttributes point_data;
  std::size_t pieces = 0;
  std::vector<VtiArray> arrays;
  VtiAttributes appended;
  std::uint64_t appended_at = 0;  // where its data begins in the file; 0: there is none
};

// Reads the document up to its appended data, which is no XML. Throws Error kUnusableVolume when it
// is not well-formed or no image, and for what XML can hold and VTK does not write.
VtiDocument read_vti_document(const InputFile& file);

// The attributes of the image, which come before anything large. Throws as read_vti_document, also
// when they are not in the file, of which the end may be missing.
VtiAttributes read_vti_image(const InputFile& beginning);

}  // namespace isomesh::import
