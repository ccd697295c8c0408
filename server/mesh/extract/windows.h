// Extraction of a surface: in windows, runs of its layers, so that it need not be in memory as a
// whole, or into one mesh.
#pragma once

#include <array>
#include <cstdint>
#include <memory>
#include <utility>

#include "server/mesh/context.h"
#include "server/mesh/extract/extract.h"
#include "server/mesh/lattice/lattice.h"
#include "server/mesh/mesh.h"
#include "server/mesh/spool.h"

namespace isomesh::mesh {

struct Extraction;
class IndexMemory;
class JoinedLayers;

// The layers of a surface.
class LayerSource {
 public:
  virtual ~LayerSource() = default;

  virtual const SurfaceCount& count() const = 0;
  std::uint32_t layers() const {
    return static_cast<std::uint32_t>(count().layer_vertices.size() - 1);
  }

  // Writes the layers [begin, end) of the surface as a mesh, whose memory is reused. It has one
  // layer more, without triangles: room for the vertices of the layer behind them, which triangles
  // name; those are left indeterminate. Vertices have the mesh's own numbers. Thread safe for
  // different meshes. Throws as the spool.
  virtual void write(std::uint32_t begin, std::uint32_t end, Mesh& mesh) = 0;
  // Frees what layers need that are not written again. Not while others near them are written.
  virtual void forget(std::uint32_t begin, std::uint32_t end) = 0;
};

// Those at an iso-value of samples.
class SurfaceWindows : public LayerSource {
 public:
  // Counts the surface, as count_surface does. Both must outlive it. What extraction needs of the
  // count beside the sizes goes to the spool, if there is one. Throws as the spool, and Error
  // kCancelled.
  template <class T>
  SurfaceWindows(const Lattice<T>& lattice, const ExtractOptions& options, const Context& context,
                 Spool* spool = nullptr);
  ~SurfaceWindows() override;

  const SurfaceCount& count() const override { return count_; }
  SurfaceCount take_count() && { return std::move(count_); }

  // Mesh::reach of the whole.
  Reach reach() const { return reach_of(count_.crossed, to_space_); }

  void write(std::uint32_t begin, std::uint32_t end, Mesh& mesh) override;
  // Writes all of it into `mesh`, whose memory is reused. The result does not depend on the number
  // of threads. Not after `forget`. Throws Error kTooLarge when there are more vertices than 32-bit
  // indices can name, before memory is taken, and kCancelled; and as the spool.
  void write_whole(const Context& context, Mesh& mesh);
  void forget(std::uint32_t begin, std::uint32_t end) override;

 private:
  const bool close_;
  const LatticeToSpace to_space_;
  SurfaceCount count_;
  std::unique_ptr<JoinedLayers> joined_;
  std::unique_ptr<Extraction> extraction_;  // null if there is no surface
  std::unique_ptr<IndexMemory> memory_;
};

// The memory in which windows are written, in bytes: for each thread, and for each vertex of the
// windows in memory, if what is joined comes from a spool. Volumes' planes have so many samples.
struct WritingMemory {
  std::uint64_t thread_bytes = 0;
  std::uint64_t vertex_bytes = 0;
};
WritingMemory writing_memory(const ExtractOptions& options, std::uint64_t plane_samples);
// Beside its layers, a window takes what is joined in so many behind them.
inline constexpr std::uint32_t kJoinedLayersBehind = 3;

}  // namespace isomesh::mesh
