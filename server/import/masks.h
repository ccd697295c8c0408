// Several masks, each of one structure -> one volume of labels.
#pragma once

#include <functional>
#include <string>
#include <vector>

#include "proto/types.h"
#include "server/import/source/names.h"

namespace isomesh::import {

// A volume in an archive: 0 outside of a structure, another value inside.
struct Mask {
  std::string file;  // its path in the archive
  // Imports it alone; writes the target of the task.
  std::function<Volume(const ImportTask& task)> read;
};

// The structures' names: those of the files without folders and suffixes, or of BIDS's entity
// `label`. Equal names are told apart by their whole paths.
std::vector<std::string> mask_names(const std::vector<std::string>& files);

// Writes the task's target. Labels are numbered from 1 in the order of `masks`, and overlap as
// segments do (labels/combinations.h). Empty masks keep their numbers, and are listed as ignored.
// Throws Error kUnusableVolume for a file that is no mask or has another grid than the first, and
// if all are empty; and all errors of `read`. All name the file.
Volume import_masks(const std::vector<Mask>& masks, const ImportTask& task);

}  // namespace isomesh::import
