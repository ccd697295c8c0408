// Makes the mesh of samples in memory: at an iso-value or by labels, of the whole volume or a part.
#pragma once

#include <span>

#include "server/codec/encode.h"
#include "server/jobs/making/make_labels.h"
#include "server/jobs/making/make_mesh.h"
#include "server/jobs/making/sample_array.h"

namespace isomesh::jobs {

// Crops the samples, then calls make_labels or make_mesh, which describe the arguments. Without
// formats, no file is written: the workspace has the mesh, as every exact file would have it. There
// are walls only by labels. Throws as those two and CroppedSamples do.
MadeLabels make_from_samples(const SampleArray& samples, const MeshRequest& request,
                             std::span<const codec::Sink> sinks, Progress& progress,
                             Workspace& workspace);

}  // namespace isomesh::jobs
