// Names of labels in a separate file beside the volume.
#pragma once

#include <filesystem>

#include "proto/types.h"
#include "server/import/source/source.h"

namespace isomesh::import {

// Adds labels from a text table among the companions to a volume whose samples look like labels and
// whose own file names none. A table belongs to the volume whose name it begins with; a table
// without a volume belongs to all. If several tables fit, none is used: no name is better than a
// wrong one. The note on labels lists the table, or the candidates.
void take_labels_beside(const Companions& companions, Volume& volume);

bool is_label_table(const std::filesystem::path& path);

}  // namespace isomesh::import
