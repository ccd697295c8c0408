// A job whose files are written while its surface is walked through; private to this folder.
#pragma once

#include <cstdint>
#include <optional>
#include <span>

#include "server/codec/encode.h"
#include "server/jobs/making/make_mesh.h"
#include "server/jobs/making/sample_array.h"
#include "server/mesh/extract/extract.h"

namespace isomesh::jobs {

// Makes the mesh, if it is worth a walk (is_walked). Files begin when the surface has been counted.
// The summary and the bytes are those of a mesh that is made as a whole. Otherwise only extracts
// the surface, into `mesh`, and returns nothing. Throws as make_mesh.
std::optional<MeshSummary> walk_stage(const SampleArray& samples, const MeshRequest& request,
                                      std::span<const codec::Sink> sinks, Progress& progress,
                                      mesh::Mesh& mesh);

}  // namespace isomesh::jobs
