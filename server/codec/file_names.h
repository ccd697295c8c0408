// Names of files in an archive that people unpack anywhere. Private to this folder.
#pragma once

#include <set>
#include <string>

#include "proto/types.h"

namespace isomesh::codec {

// Names for files, without suffixes: without a path, valid on all systems, and unique on those that
// ignore the case of letters or how they are composed. They follow from the order of the calls.
class FileNames {
 public:
  // A label's name, with its value appended if the name is taken.
  std::string of(const LabelSummary& label);

 private:
  std::set<std::string> taken_;
};

}  // namespace isomesh::codec
