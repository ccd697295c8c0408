// How far a job's files are from the surface that was extracted; private to this folder.
#pragma once

#include <cstddef>
#include <map>
#include <span>
#include <vector>

#include "server/codec/encode.h"
#include "server/jobs/making/make_mesh.h"
#include "server/jobs/making/mesh_stages.h"

namespace isomesh::jobs {

// The bytes of a job's files that round coordinates, which pass through on their way to where they
// go, kept if they are to be measured. Not thread safe, but for different files.
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

// Where the job asks for it: measures against the surface as it was extracted, both ways, what
// other programs decode from each file that rounds coordinates, and, once for all other files,
// which hold it exactly, the mesh. Looks for triangles of the mesh that intersect. `summary` has
// the labels' files. Throws Error kInternal where a file is not what was encoded, or is farther
// than max_error_mm, and kCancelled.
void certify_stage(const MeshRequest& request, const ExtractedSurface& extracted,
                   const KeptFiles& files, Progress& progress, const mesh::Mesh& mesh,
                   MeshSummary& summary);

}  // namespace isomesh::jobs
