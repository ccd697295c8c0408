// The distance of a job's files from the surface that its error counts from; private to this
// folder.
#pragma once

#include <cstddef>
#include <map>
#include <span>
#include <vector>

#include "server/codec/encode.h"
#include "server/jobs/making/make_mesh.h"
#include "server/jobs/making/mesh_stages.h"

namespace isomesh::jobs {

// Keeps the bytes of files that round coordinates, while they pass through, if they are to be
// measured. Thread safe for different files.
class KeptFiles {
 public:
  KeptFiles(const MeshRequest& request, std::span<const codec::Sink> sinks);
  KeptFiles(const KeptFiles&) = delete;

  // One for each of the job's files, in their order.
  std::span<const codec::Sink> sinks() const { return sinks_; }
  std::span<const std::byte> bytes(MeshFormat file) const { return bytes_.at(file); }

 private:
  std::map<MeshFormat, std::vector<std::byte>> bytes_;
  std::vector<codec::Sink> sinks_;
};

// If the job asks for it: measures the distances from the surface that error_reference() names,
// both ways, of each file that rounds coordinates, as other programs decode it; and of the mesh,
// once for all exact files. Looks for triangles that intersect. `summary` has the labels' files.
// Throws Error kInternal if a file is not what was encoded or is farther than max_error_mm, and
// kCancelled.
void certify_stage(const MeshRequest& request, const KeptSurface& reference, const KeptFiles& files,
                   Progress& progress, const mesh::Mesh& mesh, MeshSummary& summary);

}  // namespace isomesh::jobs
