// The names of labels that came in a file of their own, beside the volume.
#pragma once

#include <filesystem>

#include "proto/types.h"
#include "server/import/source/source.h"

namespace isomesh::import {

// Gives a volume whose samples look like labels, and whose own file names none, the labels of a
// table of text among its companions. A table belongs to the volume whose name it begins with; one
// that belongs to no volume belongs to all. If several fit, none is taken: no name is better than a
// wrong one. The note on labels names the table, or those that fit.
void take_labels_beside(const Companions& companions, Volume& volume);

// Whether the file is such a table.
bool is_label_table(const std::filesystem::path& path);

}  // namespace isomesh::import
