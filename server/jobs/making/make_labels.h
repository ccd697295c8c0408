// Makes the meshes of labels: from the samples of a volume to the bytes of the files.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "proto/types.h"
#include "server/jobs/making/make_mesh.h"
#include "server/mesh/labels/label_surface.h"
#include "server/mesh/labels/label_voxels.h"
#include "server/mesh/labels/separate.h"

namespace isomesh::jobs {

// All values of the samples, as mesh::count_labels finds them. Throws Error kInvalidParameter,
// field "labels", if the samples are no integers, kUnusableVolume if they have too many values, and
// kCancelled.
std::vector<mesh::LabelVoxels> count_values(const SampleArray& samples,
                                            const mesh::Context& context);

// The size of the walls, and of each label's own surface. Throws as make_labels does.
CountedSurface count_labels(const SampleArray& samples, const MeshParameters& parameters,
                            const mesh::Context& context);

struct MadeLabels {
  MeshSummary summary;
  std::vector<mesh::WallArea> walls;  // summary.walls_count and edge_contacts_count together
};

// As make_mesh, for parameters with labels. `sinks` has one sink for each of files_of(parameters),
// in their order. The files of the labels have no paths. `walls` is working memory; afterwards it
// holds the walls as they were encoded. Throws as make_mesh and count_values do, and Error
// kUnusableVolume, which names them, if labels are missing or there are none.
MadeLabels make_labels(const SampleArray& samples, const MeshRequest& request,
                       std::span<const codec::Sink> sinks, Progress& progress,
                       mesh::SeparatingSurface& walls);

}  // namespace isomesh::jobs
