// The walk over the rows of a slab that counts, numbers and writes: one for an iso-value's signs on
// all lattices and for labels, which are a Field each (signs-inl.h, bcc_field-inl.h, labels-inl.h).
// Compiled once for each instruction set, see slabs.cpp.
#if defined(ISOMESH_SLAB_WALK_INL_H_) == defined(HWY_TARGET_TOGGLE)
#ifdef ISOMESH_SLAB_WALK_INL_H_
#undef ISOMESH_SLAB_WALK_INL_H_
#else
#define ISOMESH_SLAB_WALK_INL_H_
#endif

#include <algorithm>
#include <array>
#include <bit>
#include <cstdint>
#include <cstring>
#include <span>
#include <utility>
#include <vector>

#include <hwy/highway.h>

#include "server/mesh/extract/crossed_rows.h"
#include "server/mesh/extract/slabs.h"
#include "server/mesh/lattice/rows-inl.h"

HWY_BEFORE_NAMESPACE();
namespace isomesh::mesh::HWY_NAMESPACE {

// The numbered rows that cells still need: the indices of the vertices that the rows' samples own,
// valid where there is a vertex, and what is known of the rows' cells. Cells are walked row by row,
// and each needs the rows around it: its own, the one behind, and both of the plane above. So one
// plane and two rows are kept, and each row that is numbered takes the place of the oldest.
template <class Cells, std::size_t kPlaces>
class RowRing {
 public:
  RowRing(const Dims& dims, IndexMemory& memory)
      : dims_(dims),
        rows_(std::size_t{dims.y} + 2),
        words_(words_of(dims.x)),
        cells_(rows_ * words_),
        memory_(memory),
        indices_(memory.take()) {}
  ~RowRing() { memory_.give_back(std::move(indices_)); }
  RowRing(const RowRing&) = delete;
  RowRing& operator=(const RowRing&) = delete;

  std::uint32_t* indices(std::uint32_t y, std::uint32_t z) {
    return indices_.get() + row(y, z) * dims_.x * kPlaces;
  }
  Cells* cells(std::uint32_t y, std::uint32_t z) { return &cells_[row(y, z) * words_]; }
  std::size_t words() const { return words_; }

 private:
  std::size_t row(std::uint32_t y, std::uint32_t z) const {
    return (std::size_t{z} * dims_.y + y) % rows_;
  }

  const Dims dims_;
  const std::size_t rows_;
  const std::size_t words_;
  std::vector<Cells> cells_;
  IndexMemory& memory_;
  IndexMemory::Block indices_;
};

// True for edges that may lie in a face of the box of a closed volume or leave it: samples there
// own them.
inline bool is_at_border(std::uint32_t at, std::uint32_t samples) {
  return at <= 1 || at + 2 >= samples;
}

template <class Field>
class SlabWriter {
 public:
  using Marched = typename Field::Marched;
  using Output = typename Field::Output;
  static constexpr std::size_t kPlaces = Field::kPlaces;

  SlabWriter(const Marched& marched, const Slab& slab, IndexMemory& memory, Output& output)
      : marched_(marched),
        dims_(marched.dims),
        slab_(slab),
        output_(output),
        mesh_(Field::mesh_of(output)),
        field_(marched, slab.begin),
        rows_(marched.dims, memory),
        vertices_((std::size_t{marched.dims.x} + 1) * kPlaces) {
    for (unsigned parity = 0; parity < 2; ++parity) {
      for (std::size_t place = 0; place < kPlaces; ++place) {
        frames_[parity][place] = field_.frame(parity, place);
      }
    }
  }

  // The triangles of a row of cells name vertices of the rows behind and above it too, so those are
  // numbered first. The plane above the slab is numbered only: its vertices are the next slab's to
  // write.
  void write() {
    const std::size_t first = slab_.begin - slab_.first_layer;
    auto vertex = static_cast<std::uint32_t>(mesh_.layer_vertices[first]);
    field_.reach(slab_.begin);
    for (std::uint32_t y = 0; y < dims_.y; ++y) number_row(y, slab_.begin, vertex);
    Triangle* out = mesh_.triangles.data() + mesh_.layer_triangles[first];
    for (std::uint32_t z = slab_.begin; z < slab_.end && z + 1 < dims_.z; ++z) {
      field_.reach(z + 1);
      number_row(0, z + 1, vertex);
      for (std::uint32_t y = 0; y + 1 < dims_.y; ++y) {
        number_row(y + 1, z + 1, vertex);
        out = write_triangles(y, z, out);
      }
    }
  }

 private:
  // Numbers the vertices of a row's samples from `vertex` on, and places those of the slab.
  void number_row(std::uint32_t y, std::uint32_t z, std::uint32_t& vertex) {
    if constexpr (Field::kHasClusters) {
      // Some edges of a cluster belong to samples of the rows before and below. Beside the first
      // rows there are none, and no clusters that would ask for them.
      const std::uint32_t before = y - std::min(y, 1U);
      const std::uint32_t below = z - std::min(z, 1U);
      const std::array rows = {rows_.indices(y, z), rows_.indices(before, z),
                               rows_.indices(y, below), rows_.indices(before, below)};
      Output* output = z < slab_.end ? &output_ : nullptr;
      vertex = field_.number_clusters(y, z, rows, vertex, output);
    }
    find_vertices(y, z);
    std::uint32_t* indices = rows_.indices(y, z);
    for (std::size_t i = 0; i < vertices_found_; ++i) {
      indices[vertices_[i]] = vertex + static_cast<std::uint32_t>(i);
    }
    if (z < slab_.end) place_vertices(y, z, vertex);
    vertex += static_cast<std::uint32_t>(vertices_found_);
  }

  // Lists the vertices that the row's samples own, in order, each as kPlaces * x + its place. A
  // flat list, because how many a sample has is hard to predict: loops over it are not.
  void find_vertices(std::uint32_t y, std::uint32_t z) {
    const auto row = field_.row(y, z);
    auto* cells = rows_.cells(y, z);
    std::uint32_t* next = vertices_.data();
    for (std::size_t w = 0; w < rows_.words(); ++w) {
      cells[w].crossed = 0;
      if (!row.may_cross(w)) continue;
      for (Word owners = row.describe(w, cells[w]); owners != 0; owners &= owners - 1) {
        const auto bit = static_cast<unsigned>(std::countr_zero(owners));
        next = row.list(w * kWordBits + bit, bit, cells[w], next);
      }
    }
    vertices_found_ = static_cast<std::size_t>(next - vertices_.data());
  }

  // Places the vertices of the row, the first of which is `vertex`.
  void place_vertices(std::uint32_t y, std::uint32_t z, std::uint32_t vertex) {
    if constexpr (Field::kHasLines) {
      mark_lines(vertex);
      field_.tell_owners(y, z, std::span(vertices_).first(vertices_found_), vertex, output_);
    }
    if (marched_.margin == 0) return place_inner(0, vertices_found_, y, z, vertex);
    std::size_t begin = 0;
    std::size_t end = vertices_found_;
    if (is_at_border(y, dims_.y) || is_at_border(z, dims_.z)) {
      begin = end;
    } else {
      while (begin < end && is_at_border(vertices_[begin] / kPlaces, dims_.x)) ++begin;
      while (begin < end && is_at_border(vertices_[end - 1] / kPlaces, dims_.x)) --end;
    }
    place_at_border(0, begin, y, z, vertex);
    place_inner(begin, end, y, z, vertex);
    place_at_border(end, vertices_found_, y, z, vertex);
  }

  // Those of the vertices [begin, end), between the lattice's own samples.
  void place_inner(std::size_t begin, std::size_t end, std::uint32_t y, std::uint32_t z,
                   std::uint32_t vertex) {
    if (begin == end) return;
    const LatticeToSpace& map = marched_.to_space;
    const std::uint32_t margin = marched_.margin;
    const auto share = field_.shares(y, z, std::span(vertices_).subspan(begin, end - begin));
    const Double4 row_at = row_origin(map, y - margin, z - margin);
    const Double4 step_x = lanes(map.step_x);
    const unsigned row_parity = marched_.parity(0, y, z);
    Vec3* out = mesh_.positions.data() + vertex;
    for (std::size_t i = begin; i < end; ++i) {
      const std::uint32_t place = vertices_[i];
      const std::uint32_t x = place / kPlaces;
      const EdgeFrame& edge = frames_[(x + row_parity) & 1][place % kPlaces];
      const Double4 at =
          row_at + step_x * static_cast<double>(static_cast<std::int32_t>(x - margin));
      const Float4 position =
          __builtin_convertvector(at + edge.start + edge.run * share(i - begin), Float4);
      std::memcpy(out + i, &position, sizeof *out);
    }
  }

  // The same where edges may lie on the border or lead to phantoms.
  void place_at_border(std::size_t begin, std::size_t end, std::uint32_t y, std::uint32_t z,
                       std::uint32_t vertex) const {
    for (std::size_t i = begin; i < end; ++i) {
      const std::uint32_t x = vertices_[i] / kPlaces;
      const std::size_t place = vertices_[i] % kPlaces;
      const BorderVertex placed =
          field_.place_at_border(x, y, z, place, frames_[marched_.parity(x, y, z)][place]);
      mesh_.positions[vertex + i] = placed.position;
      if (placed.on_border) set_flag(mesh_.on_border, vertex + i);
    }
  }

  void mark_lines(std::uint32_t vertex) const {
    for (std::size_t i = 0; i < vertices_found_; ++i) {
      if (vertices_[i] % kPlaces >= kEdgePlaces) set_flag(mesh_.on_line, vertex + i);
    }
  }

  Triangle* write_triangles(std::uint32_t y, std::uint32_t z, Triangle* out) {
    const std::uint32_t* indices = rows_.indices(y, z);
    const auto* cells = rows_.cells(y, z);
    const EdgeOffsets offsets = edge_offsets(y, z);
    const auto writer = field_.cell_writer(y, z, offsets, output_);
    for (std::size_t w = 0; w < rows_.words(); ++w) {
      if (cells[w].crossed == 0) continue;
      const std::uint32_t* places = indices + w * kWordBits * kPlaces;
      if constexpr (requires { writer.write_word(w, cells[w], places, out); }) {
        out = writer.write_word(w, cells[w], places, out);
      } else {
        for (Word rest = cells[w].crossed; rest != 0; rest &= rest - 1) {
          const auto bit = static_cast<unsigned>(std::countr_zero(rest));
          out = writer.write(w * kWordBits + bit, bit, cells[w], places + bit * kPlaces, out);
        }
      }
    }
    return out;
  }

  EdgeOffsets edge_offsets(std::uint32_t y, std::uint32_t z) {
    const std::uint32_t* origin = rows_.indices(y, z);
    EdgeOffsets offsets;
    for (unsigned corner = 0; corner < 8; ++corner) {
      const std::ptrdiff_t row = rows_.indices(y + (corner >> 1 & 1), z + (corner >> 2)) - origin;
      for (unsigned direction = 0; direction < 8; ++direction) {
        offsets[edge_name(corner, direction)] =
            row + (corner & 1) * static_cast<std::ptrdiff_t>(kPlaces) + direction;
      }
    }
    return offsets;
  }

  const Marched& marched_;
  const Dims dims_;
  const Slab slab_;
  Output& output_;
  Mesh& mesh_;
  Field field_;
  RowRing<typename Field::Cells, kPlaces> rows_;
  std::vector<std::uint32_t> vertices_;  // of the row that is numbered
  std::size_t vertices_found_ = 0;
  std::array<std::array<EdgeFrame, kPlaces>, 2> frames_ = {};  // by parity and place
};

template <class Field>
void count_slab_of(const typename Field::Marched& marched, const Slab& slab, SurfaceCount& count) {
  Field field(marched, slab.begin);
  const std::size_t words = words_of(marched.dims.x);
  typename Field::Cells cells;
  for (std::uint32_t z = slab.begin; z < slab.end; ++z) {
    field.reach(z);
    std::uint64_t vertices = 0;
    std::uint64_t triangles = 0;
    for (std::uint32_t y = 0; y < marched.dims.y; ++y) {
      const auto row = field.row(y, z);
      std::size_t first = words;
      std::size_t last = 0;
      for (std::size_t w = 0; w < words; ++w) {
        if (!row.may_cross(w)) continue;
        const WordCount found = row.count(w);
        vertices += found.vertices;
        triangles += found.triangles;
        if (found.vertices == 0) continue;
        first = std::min(first, w);
        last = w;
      }
      if (first == words) continue;
      OwnersOfRow owners;
      for (const std::size_t w : {first, last}) owners.add(w, row.describe(w, cells));
      owners.add_to(marched, y, z, count.crossed[z]);
    }
    count.layer_vertices[z + 1] = vertices;
    count.layer_triangles[z + 1] = triangles;
  }
}

template <class Field>
void write_slab_of(const typename Field::Marched& marched, const Slab& slab, IndexMemory& memory,
                   typename Field::Output& output) {
  SlabWriter<Field>(marched, slab, memory, output).write();
}

}  // namespace isomesh::mesh::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#endif
