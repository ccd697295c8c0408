#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <optional>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "server/codec/array_chunk.h"
#include "server/codec/draco_chunk.h"
#include "server/codec/encode.h"

namespace isomesh::codec {

// A surface with about `share` of its triangles, as Draco streams or as arrays.
struct GlbLevel {
  double share = 1;
  std::vector<DracoStream> streams = {};
  std::vector<ArrayChunk> arrays = {};
  bool is_solid = false;  // the only chunk is closed, manifold and oriented
  // Writes the streams or the arrays that have no bytes.
  std::function<void(const Sink&)> put_others = {};

  // Room for so many chunks.
  void make_room(std::size_t chunks, GlbCodec codec) {
    codec == GlbCodec::kDraco ? streams.resize(chunks) : arrays.resize(chunks);
  }

  std::uint64_t triangles() const {
    std::uint64_t triangles = 0;
    for (const DracoStream& stream : streams) triangles += stream.triangles;
    for (const ArrayChunk& chunk : arrays) triangles += chunk.triangles;
    return triangles;
  }

  std::size_t bytes() const {
    std::size_t bytes = 0;
    for (const DracoStream& stream : streams) bytes += glb_padded(stream.size());
    for (const ArrayChunk& chunk : arrays) bytes += chunk.size();
    return bytes;
  }

  void put(const Sink& sink) const;
};

// One surface with its own material and node.
struct GlbPart {
  std::string name;
  std::string material;
  std::array<double, 3> color = {0.8, 0.8, 0.8};  // linear
  std::optional<LabelSummary> label = {};         // written as the node's extras
  // From finest to coarsest, each with fewer triangles than the previous one. None for an empty
  // surface.
  std::vector<GlbLevel> levels = {};

  static GlbPart of_surface() { return {.name = "surface", .material = "neutral"}; }

  // Omits a level without fewer triangles than the previous one.
  void add_level(GlbLevel level) {
    const std::uint64_t triangles = level.triangles();
    if (triangles == 0) return;
    if (!levels.empty() && triangles >= levels.back().triangles()) return;
    levels.push_back(std::move(level));
  }
};

// The offsets of the levels in the file's binary data. The coarsest come first, so that a streaming
// reader has the whole surface early.
class GlbLayout {
 public:
  explicit GlbLayout(std::span<const GlbPart> parts);

  std::size_t bytes() const { return bytes_; }
  std::size_t begin(std::size_t part, std::size_t level) const { return begins_[part][level]; }
  // Refers to the parts, which must outlive it.
  const std::vector<const GlbLevel*>& order() const { return order_; }

 private:
  std::size_t bytes_ = 0;
  std::vector<std::vector<std::size_t>> begins_;
  std::vector<const GlbLevel*> order_;
};

// glTF's document of one surface, which is the root node's own, or of one surface per label, in
// child nodes. Coarser levels are nodes after all others, referred to by MSFT_lod. If the chunks'
// positions are grid steps, the nodes with meshes transform them to LPS millimetres. A solid level
// has EXT_mesh_manifold.
std::string glb_document(std::span<const GlbPart> parts, const GlbLayout& layout, const Grid& grid,
                         const Provenance& provenance);

}  // namespace isomesh::codec
