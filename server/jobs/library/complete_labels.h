// Completes the parameters of a job from its volume.
#pragma once

#include "proto/types.h"
#include "server/jobs/library/defaults.h"
#include "server/jobs/library/label_lists.h"
#include "server/store/job_store.h"

namespace isomesh::jobs {

// Completes parameters that have labels: the names and colours of the chosen labels from the
// volume, unless given, and the default displacement limit of Laplacian and Taubin smoothing, half
// the smallest spacing. Equivalent requests therefore get equal parameters, and share one result.
// Throws Error kUnusableVolume if an axis has fewer than two samples, if chosen labels are missing
// (naming them) or if there are none; and as LabelLists::counts does.
JobParameters complete_labels(JobParameters parameters, const store::Viewer& viewer,
                              const Volume& volume, LabelLists& lists);

}  // namespace isomesh::jobs
