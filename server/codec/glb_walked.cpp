// GLB of blocks, whose head tells their lengths: blocks are set aside until all are there.
#include <algorithm>
#include <atomic>
#include <memory>
#include <utility>
#include <vector>

#include "server/codec/draco/grid.h"
#include "server/codec/glb_writer.h"
#include "server/codec/walked_file.h"

namespace isomesh::codec {
namespace {

class WalkedGlb : public WalkedFile {
 public:
  explicit WalkedGlb(const WalkedContent& content)
      : content_(content),
        parameters_(content.provenance.parameters),
        cut_(content.size.triangles, content.size.layers, content.triangles_per_block),
        expected_(content.reach),
        is_within_(is_grid_of(expected_, expected_)) {
    begin_level();
  }

  void see(const mesh::Window& window) override {
    const mesh::Mesh& mesh = window.mesh;
    const mesh::Reach box =
        box_of(mesh.positions.span().first(mesh.layer_vertices[mesh.layers() - 1]));
    if (!expected_.holds(box)) is_within_ = false;
    seen_.add(box);
  }

  std::size_t parts(const mesh::Window& window) const override { return blocks_in(window).size(); }

  mesh::WindowUser::InOrder work(const mesh::Window& window, std::size_t part) override {
    if (!is_within_) return [] {};
    const auto made = std::make_shared<GlbLevel>();
    made->make_room(1, parameters_.glb_codec);
    const VertexData data = {.normals = window.normals.span()};
    encode_glb_block(window.mesh, blocks_in(window)[part], grid_, data, parameters_,
                     content_.context, 0, *made);
    return [this, made] { take(*made); };
  }

  bool end(const mesh::Topology& /*topology*/) override {
    if (!is_within_ && !seen_.is_empty()) {
      expected_ = std::exchange(seen_, {});
      is_within_ = true;
      begin_level();
      return false;
    }
    GlbPart part = GlbPart::of_surface();
    part.add_level(std::move(level_));
    write_glb({&part, 1}, grid_, content_.provenance, content_.context, content_.sink);
    return true;
  }

 private:
  struct Place {
    std::uint64_t begin = 0;
    std::size_t bytes = 0;
  };

  // Blocks on the grid of the expected box.
  void begin_level() {
    level_ = {};
    places_.clear();
    if (is_within_) grid_ = grid_of(expected_, parameters_.draco.position_bits);
    if (content_.spool != nullptr) {
      level_.put_others = [this](const Sink& sink) { put_places(sink); };
    }
  }

  std::vector<Block> blocks_in(const mesh::Window& window) const {
    return blocks_of(window.mesh, 0, window.mesh.layers() - 1, cut_);
  }

  // The next block, in the order of the file.
  void take(GlbLevel& made) {
    for (DracoStream& stream : made.streams) {
      stream.topology.reset();
      if (content_.spool != nullptr) stream.aside = put_aside(stream.bytes);
      level_.streams.push_back(std::move(stream));
    }
    for (ArrayChunk& chunk : made.arrays) {
      if (content_.spool != nullptr) put_aside(chunk.bytes);
      level_.arrays.push_back(std::move(chunk));
    }
  }

  // Returns how many bytes there were.
  std::size_t put_aside(std::vector<std::byte>& bytes) {
    const std::size_t size = bytes.size();
    bytes.resize(glb_padded(size));
    places_.push_back({content_.spool->take(bytes.size()), bytes.size()});
    content_.spool->write(places_.back().begin, bytes);
    bytes = std::vector<std::byte>();
    return size;
  }

  void put_places(const Sink& sink) const {
    std::vector<std::byte> bytes;
    for (const Place& place : places_) {
      content_.context.throw_if_stopped();
      bytes.resize(place.bytes);
      content_.spool->read(place.begin, bytes);
      sink(bytes);
    }
  }

  const WalkedContent content_;
  const MeshParameters& parameters_;
  const BlockCut cut_;
  mesh::Reach expected_;
  mesh::Reach seen_;
  std::atomic<bool> is_within_;  // all that was seen is in the expected box
  Grid grid_;
  GlbLevel level_;
  std::vector<Place> places_;
};

}  // namespace

std::unique_ptr<WalkedFile> walked_glb(const WalkedContent& content) {
  return std::make_unique<WalkedGlb>(content);
}

}  // namespace isomesh::codec
