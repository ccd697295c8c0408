// What a request for a job by labels leaves to the volume.
#pragma once

#include "proto/types.h"
#include "server/jobs/library/label_lists.h"
#include "server/store/job_store.h"

namespace isomesh::jobs {

// Says that samples of that type, which is no integer, are no labels.
[[noreturn]] void throw_no_labels(SampleType type);

// The parameters, which have labels, with all that the volume says where they say nothing: the
// names, colours and values of the labels that are chosen, and how far smoothing may move a vertex,
// half the smallest spacing. Whoever asks for the same in other words asks for the same mesh.
// Throws Error kInvalidParameter, field "labels", when the samples are no integers, and
// kUnusableVolume when labels are not there, naming them, or when there are none; and as
// LabelLists::counts does.
JobParameters settle_labels(JobParameters parameters, const store::Viewer& viewer,
                            const Volume& volume, LabelLists& lists);

}  // namespace isomesh::jobs
