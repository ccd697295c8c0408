// Files -> the images of one series.
#pragma once

#include <filesystem>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "proto/error.h"
#include "proto/types.h"
#include "server/import/dicom/choosing/named_file.h"
#include "server/import/dicom/geometry/image.h"

namespace isomesh::import::dicom {

// An uploaded file with images.
struct Source {
  NamedFile file;
  std::string series_uid;          // "3.0" for series 3 without a UID
  std::string series_description;  // UTF-8
  std::optional<std::int64_t> series_number;
  std::int64_t frame_count = 1;  // as declared, unchecked
  DicomInstance instance;
  Image image;
  std::optional<Error> fault;  // the reason if `image` is not filled in
};

// An uploaded structure set (contours/structure_set.h).
struct StructureFile {
  NamedFile file;
  std::string series_uid;
  std::string description;
  std::string frame_of_reference_uid;
};

struct Upload {
  std::vector<Source> sources;
  std::vector<StructureFile> structure_sets;
  std::vector<IgnoredObject> ignored;
  std::vector<Note> notes;
};

// Adds a file to those that the upload ignores, up to a limit. `reason` is a clause: "it is ...".
void ignore(Upload& upload, const NamedFile& file, const std::string& reason);

// Throws the error of one of several files, with the file's title.
[[noreturn]] void rethrow_for(const NamedFile& file, const Error& error);

// Reads the headers of all files. Of identical files only the first is used. Throws Error
// kUnusableVolume if a DICOM file is truncated or corrupt, or if none holds images.
Upload read_headers(std::span<const NamedFile> files, const std::filesystem::path& scratch,
                    std::uint64_t most_sample_bytes);

// Returns the structure set of the series, or the only one if `uid` is empty and there are no
// images; null for images. Throws Error kUnusableVolume with all series as choices if the upload
// has both and `uid` is empty, or several structure sets.
const StructureFile* chosen_structures(const Upload& upload, const std::string& uid);

// The images of the frame of reference of a structure set: of one series, the one with the most
// slices. Empty if there are none.
std::vector<Source> images_of(const StructureFile& structures, std::vector<Source> sources);

// Returns the sources of the series, or of the only one if `uid` is empty. Throws Error
// kUnusableVolume if that is ambiguous, with all series as choices, or if a source has a fault.
std::vector<Source> choose_series(std::vector<Source> sources, const std::string& uid);

// The identity that a mesh needs to be stored in the PACS. `data` is of any image of the series.
DicomIdentity identity_of(const DataSet& data);

}  // namespace isomesh::import::dicom
