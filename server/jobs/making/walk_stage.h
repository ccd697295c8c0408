// A job whose files are written while its surface is walked through; private to this folder.
#pragma once

#include <cstdint>
#include <span>

#include "server/codec/encode.h"
#include "server/jobs/making/make_mesh.h"
#include "server/jobs/making/sample_array.h"
#include "server/mesh/extract/extract.h"

namespace isomesh::jobs {

// Makes the mesh of a job that is_walked(). Files begin when the surface has been counted. The
// summary and the bytes are those of a mesh that is made as a whole. Throws as make_mesh.
MeshSummary walk_stage(const SampleArray& samples, const MeshRequest& request,
                       std::span<const codec::Sink> sinks, Progress& progress);

}  // namespace isomesh::jobs
