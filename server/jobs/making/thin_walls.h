// Notes on walls that are too thin for the lattice; private to this folder.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "proto/notes.h"
#include "server/jobs/making/make_mesh.h"
#include "server/jobs/making/sample_array.h"
#include "server/mesh/context.h"
#include "server/mesh/extract/extract.h"
#include "server/mesh/labels/label_voxels.h"

namespace isomesh::jobs {

// The note thin-walls, if cavities that voxels close are open in the surface at the job's iso-value
// (open_cavities.h). Looks for them only where it matters: in a mask, or if the job fills cavities
// or keeps some components. Throws Error kCancelled.
std::vector<Note> notes_on_thin_walls(const SampleArray& samples, const MeshRequest& request,
                                      const mesh::Context& context);

// The same for each label's own surface, in the box of its samples. `labels`: all of the job. The
// smallest boxes are searched, as long as all together have at most four times the samples of the
// volume, so time is bounded however many labels overlap.
std::vector<Note> notes_on_thin_walls(const SampleArray& samples,
                                      std::span<const mesh::LabelVoxels> labels,
                                      const MeshParameters& parameters,
                                      const mesh::Context& context);

// True if a job at an iso-value looks for cavities. Throws Error kCancelled.
bool searches_cavities(const SampleArray& samples, const MeshParameters& parameters,
                       const mesh::Context& context);

// An upper estimate of the memory of that search, in bytes, for a surface of that size; and of the
// search in a job by labels, whose walls have that size.
std::uint64_t cavity_search_memory(const SampleArray& samples, const mesh::SurfaceSize& surface);
std::uint64_t cavity_search_memory(const SampleArray& samples,
                                   std::span<const mesh::LabelVoxels> labels,
                                   const mesh::SurfaceSize& walls);

}  // namespace isomesh::jobs
