// Encapsulated STL, OBJ and MTL Storage (PS3.3, A.85): a mesh, and its materials, as objects of the
// study that it was made from.
#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>
#include <optional>
#include <span>
#include <string>
#include <string_view>

#include "proto/types.h"
#include "server/hospital/objects/derived_object.h"

namespace isomesh::dicom {

enum class DocumentKind {
  kStl,
  kObj,
  kMtl,  // the materials of an OBJ
};

std::string_view sop_class_of(DocumentKind kind);

// "Encapsulated OBJ" for the SOP class of that storage; also knows reports. Throws Error kInternal
// for a class of which no objects are made.
std::string_view name_of_class(std::string_view sop_class);

// The largest even length of an element of explicit length.
inline constexpr std::uint64_t kMostDocumentBytes = 4'294'967'294;

// The attributes of the object besides its document. Texts are UTF-8.
struct DocumentObject {
  DocumentKind kind = DocumentKind::kStl;
  DerivedObject common;              // the title is the document's, too
  std::string content_description;   // one sentence: iso-value, scheme, passes
  std::string algorithm_parameters;  // JSON
  // The segment of the mesh; empty for a mesh at an iso-value, and for several segments.
  std::optional<DicomSegment> segment = {};
  // The Encapsulated MTL in the same series that the OBJ names kMaterialsName; empty: none.
  std::string materials_uid = {};
};

// The bytes of the file before and after the document.
struct Envelope {
  std::string before;
  std::string after;
};

// Returns the envelope of a document of that size. Throws Error kTooLarge beyond
// kMostDocumentBytes.
Envelope make_envelope(const DocumentObject& object, std::uint64_t document_bytes);

}  // namespace isomesh::dicom
