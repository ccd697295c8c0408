// Encapsulated STL Storage (PS3.3, A.85.1): a mesh as an object of the study it was made from.
#pragma once

#include <chrono>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <optional>
#include <span>
#include <string>
#include <string_view>

#include "proto/types.h"

namespace isomesh::dicom {

inline constexpr std::string_view kEncapsulatedStlStorage = "1.2.840.10008.5.1.4.1.1.104.3";

// The largest even length of an element of explicit length.
inline constexpr std::uint64_t kMostDocumentBytes = 4'294'967'294;

// The attributes of the object besides its mesh. Texts are UTF-8.
struct StlObject {
  const DicomIdentity& identity;  // of the images
  std::string series_uid;
  std::string sop_instance_uid;
  std::int64_t series_number = 0;
  std::string title;  // of the series and the document
  std::chrono::system_clock::time_point made;
  std::string station_name;
  std::string content_description;   // one sentence: iso-value, scheme, passes
  std::string algorithm_parameters;  // JSON
  // The segment of the mesh; empty for a mesh at an iso-value.
  std::optional<DicomSegment> segment = {};
};

// The bytes of the file before and after the mesh.
struct StlEnvelope {
  std::string before;
  std::string after;
};

// Returns the envelope of an STL of that size. Throws Error kTooLarge beyond kMostDocumentBytes.
StlEnvelope make_envelope(const StlObject& object, std::uint64_t stl_bytes);

}  // namespace isomesh::dicom
