// GLB of a surface as it is, whose head tells the box of the vertices: until that is known, every
// array is set aside, each window's part at its place.
#include <algorithm>
#include <cstddef>
#include <memory>
#include <utility>
#include <vector>

#include "server/codec/draco/grid.h"
#include "server/codec/glb_writer.h"
#include "server/codec/plain_chunk.h"
#include "server/codec/walked_file.h"

namespace isomesh::codec {
namespace {

class WalkedPlainGlb : public WalkedFile {
 public:
  explicit WalkedPlainGlb(const WalkedContent& content)
      : content_(content),
        parameters_(content.provenance.parameters),
        chunk_(describe_plain(content.size.vertices, content.size.triangles, parameters_)) {
    check_glb_size(chunk_.size(), parameters_);
    if (content_.spool != nullptr) {
      begin_ = content_.spool->take(chunk_.size());
    } else {
      kept_.resize_for_overwrite(chunk_.size());
    }
  }

  void see(const mesh::Window& window) override { box_.add(box_of(own_positions(window))); }

  std::size_t parts(const mesh::Window& /*window*/) const override { return 2; }

  mesh::WindowUser::InOrder work(const mesh::Window& window, std::size_t part) override {
    part == 0 ? put_vertices(window) : put_triangles(window);
    return [] {};
  }

  bool end(const mesh::Topology& topology) override {
    GlbLevel level;
    level.is_solid = is_solid(topology);
    level.put_others = [this](const Sink& sink) { put_all(sink); };
    chunk_.bounds = {box_.low, box_.high};
    level.arrays.push_back(std::move(chunk_));
    bytes_ = level.bytes();
    GlbPart surface = GlbPart::of_surface();
    surface.add_level(std::move(level));
    const Grid grid = box_.is_empty() ? Grid() : grid_of(box_, parameters_.draco.position_bits);
    write_glb({&surface, 1}, grid, content_.provenance, content_.context, content_.sink);
    return true;
  }

 private:
  static constexpr std::size_t kPieceBytes = std::size_t{128} << 10;

  static std::span<const mesh::Vec3> own_positions(const mesh::Window& window) {
    const mesh::Mesh& mesh = window.mesh;
    return mesh.positions.span().first(mesh.layer_vertices[mesh.layers() - 1]);
  }

  // The elements from that one on.
  template <class Element>
  void put(GlbArray::Kind kind, std::uint64_t first, std::span<const Element> elements) {
    if (elements.empty()) return;
    const auto array = std::ranges::find(chunk_.arrays, kind, &GlbArray::kind);
    const std::uint64_t at = array->begin + first * sizeof(Element);
    const auto bytes = std::as_bytes(elements);
    if (content_.spool != nullptr) return content_.spool->write(begin_ + at, bytes);
    std::ranges::copy(bytes, kept_.data() + at);
  }

  void put_vertices(const mesh::Window& window) {
    const std::span<const mesh::Vec3> own = own_positions(window);
    put(GlbArray::Kind::kPositions, window.first_vertex, own);
    if (!parameters_.normals) return;
    put(GlbArray::Kind::kNormals, window.first_vertex, window.normals.span().first(own.size()));
  }

  // By the surface's numbers.
  void put_triangles(const mesh::Window& window) {
    const auto shift = static_cast<std::uint32_t>(window.first_vertex);
    const std::span<const mesh::Triangle> own = window.mesh.triangles.span();
    std::vector<mesh::Triangle> piece;
    for (std::size_t begin = 0; begin < own.size(); begin += piece.size()) {
      content_.context.throw_if_stopped();
      piece.clear();
      const std::size_t count = std::min(kPieceBytes / sizeof(mesh::Triangle), own.size() - begin);
      for (const auto& [a, b, c] : own.subspan(begin, count)) {
        piece.push_back({a + shift, b + shift, c + shift});
      }
      put(GlbArray::Kind::kIndices, window.first_triangle + begin,
          std::span<const mesh::Triangle>(piece));
    }
  }

  void put_all(const Sink& sink) const {
    std::vector<std::byte> piece;
    for (std::size_t begin = 0; begin < bytes_; begin += piece.size()) {
      content_.context.throw_if_stopped();
      piece.resize(std::min(kPieceBytes, bytes_ - begin));
      if (content_.spool != nullptr) {
        content_.spool->read(begin_ + begin, piece);
      } else {
        std::copy_n(kept_.data() + begin, piece.size(), piece.data());
      }
      sink(piece);
    }
  }

  const WalkedContent content_;
  const MeshParameters& parameters_;
  ArrayChunk chunk_;
  mesh::Reach box_;
  std::uint64_t begin_ = 0;       // in the spool
  mesh::Buffer<std::byte> kept_;  // without a spool
  std::size_t bytes_ = 0;
};

}  // namespace

std::unique_ptr<WalkedFile> walked_plain_glb(const WalkedContent& content) {
  return std::make_unique<WalkedPlainGlb>(content);
}

}  // namespace isomesh::codec
