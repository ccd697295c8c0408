#pragma once

#include <filesystem>
#include <string>

#include "base/text.h"

namespace isomesh::import {

// A DICOM file, and what messages call it.
struct NamedFile {
  std::filesystem::path path;
  std::string name;   // within sentences and in lists; printable
  std::string title;  // at the beginning of its error; printable
};

// An uploaded file is called by its file name, without folders.
inline NamedFile named(const std::filesystem::path& path) {
  const std::string name = printable(path.filename().string());
  return {path, name, "File " + in_quotes(name)};
}

}  // namespace isomesh::import
