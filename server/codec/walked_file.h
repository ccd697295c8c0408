// Files that are written while a surface is walked through (server/mesh/walk), window by window.
#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>

#include "proto/types.h"
#include "server/codec/encode.h"
#include "server/mesh/context.h"
#include "server/mesh/mesh.h"
#include "server/mesh/spool.h"
#include "server/mesh/topology/topology.h"
#include "server/mesh/walk/walk.h"

namespace isomesh::codec {

// In GLB. Measured: with half as many, duplicated seam vertices cost 1.5 % more bytes; with twice
// as many, the first block arrives later and its vertices no longer fit 16 bits.
inline constexpr std::size_t kTrianglesPerBlock = 100'000;

class WalkedFile {
 public:
  virtual ~WalkedFile() = default;

  // Every window, in their order, before any work on it. By one thread at a time.
  virtual void see(const mesh::Window& /*window*/) {}
  // Into how many parts the work on a window is divided.
  virtual std::size_t parts(const mesh::Window& window) const = 0;
  // As WindowUser::work.
  virtual mesh::WindowUser::InOrder work(const mesh::Window& window, std::size_t part) = 0;
  // After all windows, whose topology is known then. Returns false if they have to come again, from
  // the first, with which the file begins again; the second time they do not have to.
  virtual bool end(const mesh::Topology& /*topology*/) { return true; }
};

// Its members must outlive the file.
struct WalkedContent {
  const Provenance& provenance;
  MeshFormat format;
  mesh::SurfaceSize size;
  mesh::Reach reach;
  const Sink& sink;
  mesh::Spool* spool;           // for what would take much memory; null: it does
  const mesh::Context context;  // for cancelling
  std::size_t triangles_per_block = kTrianglesPerBlock;
};

// True if a file of that format can be written so with these parameters. If not, its encoder needs
// the surface as a whole. The bytes are the same.
bool is_walked(MeshFormat format, const MeshParameters& parameters);

// How many layers the windows need to have; 0: it does not matter.
std::uint32_t walked_depth(MeshFormat format, const MeshParameters& parameters,
                           const mesh::SurfaceSize& size);

// An upper bound of the memory of such a file, beside the walk's.
std::uint64_t walked_memory(MeshFormat format, const MeshParameters& parameters,
                            const mesh::SurfaceSize& size, bool has_spool);

// Begins a file. Throws as its encoder does.
std::unique_ptr<WalkedFile> walked_file(const WalkedContent& content);

// Those of one format each.
std::unique_ptr<WalkedFile> walked_stl(const WalkedContent& content);
std::unique_ptr<WalkedFile> walked_glb(const WalkedContent& content);
std::unique_ptr<WalkedFile> walked_plain_glb(const WalkedContent& content);

}  // namespace isomesh::codec
