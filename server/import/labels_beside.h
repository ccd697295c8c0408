// Names of labels in a separate file beside the volume.
#pragma once

#include <filesystem>

#include "proto/types.h"
#include "server/import/source/source.h"

namespace isomesh::import {

// Adds labels from a text table among the companions to a volume whose own file names none, and
// whose canonical file is the task's target. The volume must look like labels, of which the table
// names one at least. Other volumes become labels if the table says so: all samples are whole or
// nearly whole numbers, none is negative, the table names at least half of their values other than
// 0, and these are few, or the table has the volume's name and they lie in regions. Floats then
// become integers. So a table beside an image changes nothing. Labels that a volume has without
// names, such as those of a palette, get theirs.
// A table belongs to the volume whose name it begins with; a table without a volume belongs to all.
// If several tables fit, none is used: no name is better than a wrong one. The note on labels lists
// the table, or the candidates.
void take_labels_beside(const Companions& companions, const ImportTask& task, Volume& volume);

bool is_label_table(const std::filesystem::path& path);

}  // namespace isomesh::import
