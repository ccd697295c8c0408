#pragma once

#include <string>

namespace isomesh::import {

// A client's name for an upload.
struct UploadName {
  std::string text = {};
  // A person chose it: it precedes names in the file. Otherwise it is the file's own, used if the
  // file contains no name.
  bool is_chosen = false;

  bool operator==(const UploadName&) const = default;
};

}  // namespace isomesh::import
