// The messages between the daemon and isomesh-import, over a socket. The daemon sends one order.
// The import answers with lines of JSON; the last one has the volume or the error.
#pragma once

#include <algorithm>
#include <array>
#include <chrono>
#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>
#include <string_view>
#include <variant>
#include <vector>

#include "proto/error.h"
#include "proto/types.h"
#include "server/volume/geometry.h"

namespace isomesh::import {

// The expected content of a file from a PACS: the response to a request for one series.
struct PeersSeries {
  std::string content_type;  // the response's header
  std::string study;         // UIDs
  std::string series;
  std::vector<std::string> instances;  // all of them, ascending, unique

  bool operator==(const PeersSeries&) const = default;
};

struct ImportOptions {
  std::optional<RawDescription> raw = {};  // empty: the file has a header
  std::string series = {};                 // UID of the DICOM series; empty: the only one
  // Index of the volume in its file, from 0; empty: the only one.
  std::optional<std::uint32_t> volume = {};
  // The archive's member to read, or kDicomMember for the volume of its DICOM files; empty: the
  // only one.
  std::string member = {};
  bool masks = false;                        // the archive's volumes are masks (masks.h)
  std::vector<std::string> accept = {};      // names of notes whose errors are overridden
  std::optional<NiftiForm> nifti_form = {};  // empty: the sform, if present
  // Millimetres along x, y and z, for a file that gives none.
  std::optional<std::array<double, 3>> spacing = {};
  std::optional<SaidModality> modality = {};  // empty: what the file says
  std::optional<PeersSeries> peers = {};      // empty: a client's upload

  bool accepts(NoteCode code) const {
    return std::ranges::find(accept, describe(code).name) != accept.end();
  }

  bool operator==(const ImportOptions&) const = default;
};

// All DICOM files of an archive; not a valid member name.
inline constexpr std::string_view kDicomMember = "*.dcm";

struct ImportTask {
  std::filesystem::path source;   // the uploaded file
  std::filesystem::path scratch;  // a folder for temporary files
  std::filesystem::path target;   // the canonical file to write, within `scratch`
  ImportOptions options = {};
  volume::SizeLimits limits = {};
};

struct ImportBounds {
  std::uint64_t memory_bytes = std::uint64_t{4} << 30;  // without the mapped samples
  std::chrono::seconds time = std::chrono::minutes(10);
};

struct ImportOrder {
  ImportTask task;
  ImportBounds bounds;
};

// Reading a file with a PACS's response in DICOM JSON (PS3.18, F).
struct ResponseTask {
  std::filesystem::path source;
};

struct ResponseOrder {
  ResponseTask task;
  ImportBounds bounds;
};

// An object that a PACS reported; missing members are empty. UIDs are valid (is_uid).
struct PeersObject {
  std::string study = {};
  std::string series = {};
  std::string instance = {};
  std::string patient_id = {};
  std::string patient_name = {};
  std::string study_date = {};  // DA
  std::string study_description = {};
  std::string modality = {};
  std::string series_description = {};
  std::optional<std::uint32_t> instances = {};  // of the series
  // The reason why the PACS did not store an instance (PS3.18, I.2.2).
  std::optional<std::uint16_t> failure = {};
  // Of the only series that a segmentation refers to.
  std::string segmented_series = {};
  // Of a workitem (PS3.4, CC.2.5): `study` and `series` are those of its only input.
  std::string workitem_state = {};
  std::string readiness = {};                // of the input
  std::vector<std::string> procedures = {};  // codes, each VALUE^SCHEME^MEANING

  bool operator==(const PeersObject&) const = default;
};

struct PeersResponse {
  std::vector<PeersObject> objects;  // search results
  std::vector<PeersObject> stored;   // reported as stored
  std::vector<PeersObject> failed;   // reported as not stored

  bool operator==(const PeersResponse&) const = default;
};

std::string to_message(const ImportOrder& order);
std::string to_message(const ResponseOrder& order);

// Returns either order. Throws Error kInternal if the message is malformed.
std::variant<ImportOrder, ResponseOrder> order_from(std::string_view message);

// Return one line, with its line break.
std::string begun_message();
std::string reading_message(std::string_view format);
std::string volume_message(const Volume& volume);
std::string response_message(const PeersResponse& response);
std::string error_message(const Error& error);

struct ImportReport {
  bool begun = false;   // it has its order and will open the file
  std::string reading;  // the last format it named; printable
  std::optional<Volume> volume;
  std::optional<PeersResponse> response;
  std::optional<Error> error;
};

// Reads whole lines; ignores an incomplete last line. Throws Error kInternal if a line is
// malformed.
ImportReport report_from(std::string_view messages);

}  // namespace isomesh::import
