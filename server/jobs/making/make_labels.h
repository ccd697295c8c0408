// What a job by labels does between the samples of its volume and the bytes of its files.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "proto/types.h"
#include "server/jobs/making/make_mesh.h"
#include "server/mesh/labels/labels.h"
#include "server/mesh/labels/separate.h"

namespace isomesh::jobs {

// All values that the samples have, as mesh::count_labels finds them. Throws Error
// kInvalidParameter, field "labels", when the samples are no integers, kUnusableVolume when they
// have too many values, and kCancelled.
std::vector<mesh::LabelVoxels> count_values(const SampleArray& samples,
                                            const mesh::Context& context);

// How large the walls are, and each label's own surface. Throws as make_labels does.
CountedSurface count_labels(const SampleArray& samples, const MeshParameters& parameters,
                            const mesh::Context& context);

// As make_mesh, for parameters with labels: separates them, smooths and measures them, and encodes.
// `sinks` has one for each of files_of(parameters), in their order. The files of the labels have no
// paths. `walls` is worked in, and left as it was encoded. Throws as make_mesh and count_values do,
// and Error kUnusableVolume, which names them, when labels are not there, or there are none.
MeshSummary make_labels(const SampleArray& samples, const MeshRequest& request,
                        std::span<const codec::Sink> sinks, Progress& progress,
                        mesh::SeparatingSurface& walls);

}  // namespace isomesh::jobs
