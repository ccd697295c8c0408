// Files -> the images of one series.
#pragma once

#include <filesystem>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "proto/error.h"
#include "proto/types.h"
#include "server/import/dicom/geometry/image.h"

namespace isomesh::import::dicom {

// A file of the upload that holds images.
struct Source {
  std::filesystem::path path;
  std::string series_uid;          // "3.0" of series 3 where there is none
  std::string series_description;  // UTF-8
  std::int64_t frame_count = 1;    // as it tells, unchecked
  DicomInstance instance;
  Image image;
  std::optional<Error> fault;  // why `image` is not filled in
};

struct Upload {
  std::vector<Source> sources;
  std::vector<IgnoredObject> ignored;
  std::vector<Note> notes;
};

// Reads the headers of all files. One that came twice, byte for byte, is taken once. Throws Error
// kUnusableVolume when a DICOM file is truncated or corrupt, or none holds images.
Upload read_headers(std::span<const std::filesystem::path> files,
                    const std::filesystem::path& scratch, std::uint64_t most_sample_bytes);

// The sources of the series, or of the only one when `uid` is empty. Throws Error kUnusableVolume
// when that leaves a choice, with all series in its choices, or a source has a fault.
std::vector<Source> choose_series(std::vector<Source> sources, const std::string& uid);

// The identity that a mesh needs to be sent back to the archive. `data` is of any image of the
// series.
DicomIdentity identity_of(const DataSet& data);

}  // namespace isomesh::import::dicom
