// Encapsulated STL Storage (PS3.3, A.85.1): a mesh as an object of the study that it was made from.
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

// The most that an element of a known length holds, which is even.
inline constexpr std::uint64_t kMostDocumentBytes = 4'294'967'294;

// What an object says beside its mesh. Texts are UTF-8.
struct StlObject {
  const DicomIdentity& identity;  // of the images
  std::string series_uid;
  std::string sop_instance_uid;
  std::int64_t series_number = 0;
  std::string title;  // of series and document
  std::chrono::system_clock::time_point made;
  std::string station_name;
  std::string content_description;   // in a sentence: iso-value, scheme, passes
  std::string algorithm_parameters;  // JSON
  // The segment that the mesh is of; empty for one at an iso-value.
  std::optional<DicomSegment> segment = {};
};

// The file before and after its mesh.
struct StlEnvelope {
  std::string before;
  std::string after;
};

// The envelope of a mesh of so many bytes. Throws Error kTooLarge beyond kMostDocumentBytes.
StlEnvelope make_envelope(const StlObject& object, std::uint64_t stl_bytes);

}  // namespace isomesh::dicom
