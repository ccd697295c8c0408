// The samples of labels. Everywhere else, requests included, labels are those of the volume's
// lists; its samples have other numbers if segments overlap or labels have 64 bits
// (LabelEntry::values).
#pragma once

#include <cstdint>

#include "proto/types.h"

namespace isomesh::jobs {

// The labels of the volume whose samples have other values than their own number.
LabelValues values_of(const Volume& volume);

// The samples of each label that does not have just its own value, for mesh::labels_of. `lists` are
// those of a request: labels of the volume that a label joins. A label that is in a list is no
// longer a label itself, unless it has a list, too. Labels that the volume does not have add
// nothing. The lists of jobs of older versions are those of samples, and stay so if they can be
// told from others. The background, 0, has the samples that belong to no label then.
LabelValues label_samples(const LabelValues& lists, const Volume& volume);

// Parameters by labels whose lists are those of the samples, as far as the chosen labels need them.
// `parameters` were completed (complete_labels.h).
MeshParameters with_label_samples(MeshParameters parameters, const Volume& volume);

// Throws Error kInvalidParameter for a background other than 0 of a volume whose samples have other
// numbers than its labels: 0 is outside of all of them.
void check_background(const Volume& volume, std::int64_t background);

}  // namespace isomesh::jobs
