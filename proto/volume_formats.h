// The formats in which volumes are uploaded. One table holds what a person has to know;
// openapi.yaml, the help of the command, the page and docs/uploads.md follow from it. The readers
// stand in server/import/readers.cpp. Thread safe.
#pragma once

#include <span>
#include <string>
#include <string_view>

namespace isomesh {

struct VolumeFormat {
  std::string_view name;      // in the API, stable
  std::string_view title;     // for a person
  std::string_view suffixes;  // of its files, separated by spaces; a file is not recognised by them
  std::string_view content;   // what of the format is read, in Markdown
};

// All formats; raw samples are the last.
std::span<const VolumeFormat> volume_formats();

// Throws Error kInternal for an unknown name.
const VolumeFormat& volume_format(std::string_view name);

// The titles of all formats except raw samples: "NIfTI, NRRD, ... or DICOM".
std::string volume_format_titles();

}  // namespace isomesh
