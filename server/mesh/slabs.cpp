// The code between HWY_BEFORE_NAMESPACE and HWY_AFTER_NAMESPACE is compiled once for each
// instruction set: this file includes itself through Highway's foreach_target.h. No vector types
// are needed here; what gains is what the compiler makes of 64-bit counts, shifts and four-lane
// positions.
#include "server/mesh/slabs.h"

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "server/mesh/slabs.cpp"
#include <atomic>
#include <bit>
#include <cstring>
#include <functional>
#include <numeric>
#include <utility>

#include <hwy/foreach_target.h>
#include <hwy/highway.h>

#include "proto/samples.h"
#include "server/mesh/signs-inl.h"

HWY_BEFORE_NAMESPACE();
namespace isomesh::mesh::HWY_NAMESPACE {
namespace {

// For each set of directions its members in order.
constexpr auto kMembers = [] {
  std::array<std::array<std::uint8_t, kPlaces>, 256> members = {};
  for (unsigned set = 0; set < 256; ++set) {
    std::size_t found = 0;
    for (unsigned direction = 0; direction < 8; ++direction) {
      if ((set >> direction & 1) != 0) {
        members[set][found++] = static_cast<std::uint8_t>(direction);
      }
    }
  }
  return members;
}();

// What numbering a row leaves for the triangles of the layer: the indices of the vertices that the
// row's samples own (valid where an edge is crossed), and its crossed cells with their cases.
struct WordCells {
  Word crossed = 0;
  std::array<std::uint8_t, kWordBits> cases;
};

// The numbered rows that cells still need. Cells are walked row by row, and each needs the rows
// around it: its own, the one behind, and both of the plane above. So one plane and two rows are
// kept, and each row that is numbered takes the place of the oldest.
class RowRing {
 public:
  RowRing(const Dims& dims, IndexMemory& memory)
      : dims_(dims),
        rows_(std::size_t{dims.y} + 2),
        words_((std::size_t{dims.x} + kWordBits - 1) / kWordBits),
        memory_(memory),
        indices_(memory.take()),
        cells_(rows_ * words_) {}
  ~RowRing() { memory_.give_back(std::move(indices_)); }
  RowRing(const RowRing&) = delete;
  RowRing& operator=(const RowRing&) = delete;

  std::uint32_t* indices(std::uint32_t y, std::uint32_t z) {
    return indices_.get() + row(y, z) * dims_.x * kPlaces;
  }
  WordCells* cells(std::uint32_t y, std::uint32_t z) { return &cells_[row(y, z) * words_]; }
  std::size_t words() const { return words_; }

 private:
  std::size_t row(std::uint32_t y, std::uint32_t z) const {
    return (std::size_t{z} * dims_.y + y) % rows_;
  }

  const Dims dims_;
  const std::size_t rows_;
  const std::size_t words_;
  IndexMemory& memory_;
  IndexMemory::Block indices_;
  std::vector<WordCells> cells_;
};

// Four lanes, of which the last is idle: positions in double precision until they are stored.
using Double4 = double __attribute__((vector_size(32)));
using Float4 = float __attribute__((vector_size(16)));

HWY_INLINE Double4 lanes(const std::array<double, 3>& offset) {
  return Double4{offset[0], offset[1], offset[2], 0};
}

// What placing a vertex on an edge needs to know of the edge, relative to the sample that owns it.
struct EdgeFrame {
  std::ptrdiff_t from = 0;  // the samples at its ends
  std::ptrdiff_t to = 0;
  Double4 start = {};  // where it begins and how it runs, in millimetres
  Double4 run = {};
};

template <class T>
class SlabWriter {
 public:
  SlabWriter(const Extraction<T>& extraction, const Slab& slab, IndexMemory& memory, Mesh& mesh)
      : extraction_(extraction),
        lattice_(extraction.lattice),
        dims_(extraction.dims),
        slab_(slab),
        mesh_(mesh),
        signs_(extraction, slab.begin),
        rows_(extraction.dims, memory),
        crossings_((std::size_t{extraction.dims.x} + 1) * kPlaces) {
    for (unsigned parity = 0; parity < 2; ++parity) {
      for (unsigned direction = 1; direction < 8; ++direction) {
        const EdgeEnds ends = extraction.splits[parity].ends[direction];
        EdgeFrame& frame = frames_[parity][direction];
        frame.from = sample_offset(ends.from);
        frame.to = sample_offset(ends.to);
        frame.start = space_offset(ends.from);
        frame.run = space_offset(ends.to) - frame.start;
      }
    }
  }

  // The triangles of a row of cells name vertices of the rows behind and above it too, so those are
  // numbered first. The plane above the slab is numbered only: its vertices are the next slab's to
  // write.
  void write() {
    auto vertex = static_cast<std::uint32_t>(mesh_.layer_vertices[slab_.begin]);
    signs_.reach(slab_.begin);
    for (std::uint32_t y = 0; y < dims_.y; ++y) number_row(y, slab_.begin, vertex);
    Triangle* out = mesh_.triangles.data() + mesh_.layer_triangles[slab_.begin];
    for (std::uint32_t z = slab_.begin; z < slab_.end && z + 1 < dims_.z; ++z) {
      signs_.reach(z + 1);
      number_row(0, z + 1, vertex);
      for (std::uint32_t y = 0; y + 1 < dims_.y; ++y) {
        number_row(y + 1, z + 1, vertex);
        out = write_triangles(y, z, out);
      }
    }
  }

 private:
  std::ptrdiff_t sample_offset(unsigned corner) const {
    const std::ptrdiff_t row = lattice_.dims.x;
    const std::ptrdiff_t plane = row * lattice_.dims.y;
    return (corner & 1) + (corner >> 1 & 1) * row + (corner >> 2) * plane;
  }

  Double4 space_offset(unsigned corner) const {
    const LatticeToSpace& map = lattice_.to_space;
    return lanes(map.step_x) * (corner & 1) + lanes(map.step_y) * (corner >> 1 & 1) +
           lanes(map.step_z) * (corner >> 2);
  }

  // Numbers the vertices of a row's samples from `vertex` on, and places those of the slab.
  void number_row(std::uint32_t y, std::uint32_t z, std::uint32_t& vertex) {
    find_crossings(y, z);
    std::uint32_t* indices = rows_.indices(y, z);
    for (std::size_t i = 0; i < crossings_found_; ++i) {
      indices[crossings_[i]] = vertex + static_cast<std::uint32_t>(i);
    }
    if (z < slab_.end) place_vertices(y, z, vertex);
    vertex += static_cast<std::uint32_t>(crossings_found_);
  }

  // Lists the crossed edges that the row's samples own, in order, each as kPlaces * x + direction.
  // A flat list, because how many a sample has is hard to predict: loops over it are not.
  void find_crossings(std::uint32_t y, std::uint32_t z) {
    const CellRow row = signs_.row(y, z);
    const unsigned row_parity = extraction_.parity(0, y, z);
    WordCells* cells = rows_.cells(y, z);
    std::uint32_t* next = crossings_.data();
    for (std::size_t w = 0; w < rows_.words(); ++w) {
      cells[w].crossed = 0;
      if (!row.may_cross(w)) continue;
      const CornerWords corners = row.corners(w);
      const std::array<Word, 8> crossed = row.crossed_edges(w, corners);
      cells[w].crossed = row.crossed_cells(w, corners);
      cells[w].cases = transpose(corners);
      Word owners = std::accumulate(crossed.begin(), crossed.end(), Word{0}, std::bit_or());
      for (; owners != 0; owners &= owners - 1) {
        const auto bit = static_cast<unsigned>(std::countr_zero(owners));
        const std::size_t x = w * kWordBits + bit;
        const unsigned directions =
            extraction_.splits[(x + row_parity) & 1].crossed[cells[w].cases[bit]] &
            row.existing_at(x);
        // All eight places of the list are written, and only the valid ones kept.
        const auto& members = kMembers[directions];
        for (std::size_t i = 0; i < kPlaces; ++i) {
          next[i] = static_cast<std::uint32_t>(x * kPlaces) + members[i];
        }
        next += std::popcount(directions);
      }
    }
    crossings_found_ = static_cast<std::size_t>(next - crossings_.data());
  }

  // Places the vertices of the row's crossings, the first of which is `vertex`.
  void place_vertices(std::uint32_t y, std::uint32_t z, std::uint32_t vertex) const {
    if (extraction_.margin == 0) return place_inner<0>(0, crossings_found_, y, z, vertex);
    // Edges that lie in a face of the volume's box or leave it have samples here as their owners.
    const auto is_at_border = [](std::uint32_t at, std::uint32_t samples) {
      return at <= 1 || at + 2 >= samples;
    };
    std::size_t begin = 0;
    std::size_t end = crossings_found_;
    if (is_at_border(y, dims_.y) || is_at_border(z, dims_.z)) {
      begin = end;
    } else {
      while (begin < end && is_at_border(crossings_[begin] / kPlaces, dims_.x)) ++begin;
      while (begin < end && is_at_border(crossings_[end - 1] / kPlaces, dims_.x)) --end;
    }
    place_at_border(0, begin, y, z, vertex);
    place_inner<1>(begin, end, y, z, vertex);
    place_at_border(end, crossings_found_, y, z, vertex);
  }

  // Those of the crossings [begin, end), of edges between the lattice's own samples.
  template <std::uint32_t kMargin>
  void place_inner(std::size_t begin, std::size_t end, std::uint32_t y, std::uint32_t z,
                   std::uint32_t vertex) const {
    if (begin == end) return;
    const LatticeToSpace& map = lattice_.to_space;
    const T* samples =
        lattice_.samples - kMargin +
        (std::size_t{z - kMargin} * lattice_.dims.y + (y - kMargin)) * lattice_.dims.x;
    const Double4 row_at =
        lanes(map.origin) + lanes(map.step_y) * (y - kMargin) + lanes(map.step_z) * (z - kMargin);
    const Double4 step_x = lanes(map.step_x);
    const unsigned row_parity = extraction_.parity(0, y, z);
    Vec3* out = mesh_.positions.data() + vertex;
    for (std::size_t i = begin; i < end; ++i) {
      const std::uint32_t crossing = crossings_[i];
      const std::uint32_t x = crossing / kPlaces;
      const EdgeFrame& edge = frames_[(x + row_parity) & 1][crossing % kPlaces];
      const double share =
          extraction_.placement.share(samples[x + edge.from], samples[x + edge.to]);
      const Double4 at =
          row_at + step_x * static_cast<double>(static_cast<std::int32_t>(x - kMargin));
      const Float4 position = __builtin_convertvector(at + edge.start + edge.run * share, Float4);
      std::memcpy(out + i, &position, sizeof *out);
    }
  }

  // The same where edges may lie on the border or lead to phantoms.
  void place_at_border(std::size_t begin, std::size_t end, std::uint32_t y, std::uint32_t z,
                       std::uint32_t vertex) const {
    for (std::size_t i = begin; i < end; ++i) {
      const std::uint32_t x = crossings_[i] / kPlaces;
      const CellSplit& split = extraction_.splits[extraction_.parity(x, y, z)];
      const auto placed =
          extraction_.border->place({std::int64_t{x} - 1, std::int64_t{y} - 1, std::int64_t{z} - 1},
                                    split.ends[crossings_[i] % kPlaces]);
      mesh_.positions[vertex + i] = placed.position;
      if (!placed.on_border) continue;
      // Another slab may have its vertices' bits in the same word.
      std::atomic_ref(mesh_.on_border[(vertex + i) / kFlagBits])
          .fetch_or(Word{1} << ((vertex + i) % kFlagBits), std::memory_order_relaxed);
    }
  }

  Triangle* write_triangles(std::uint32_t y, std::uint32_t z, Triangle* out) {
    const std::uint32_t* indices = rows_.indices(y, z);
    const WordCells* cells = rows_.cells(y, z);
    const auto offsets = index_offsets(y, z);
    const unsigned row_parity = extraction_.parity(0, y, z);
    for (std::size_t w = 0; w < rows_.words(); ++w) {
      for (Word rest = cells[w].crossed; rest != 0; rest &= rest - 1) {
        const auto bit = static_cast<unsigned>(std::countr_zero(rest));
        const std::size_t x = w * kWordBits + bit;
        const CellCase& cell = extraction_.splits[(x + row_parity) & 1].cases[cells[w].cases[bit]];
        const std::uint32_t* places = indices + x * kPlaces;
        for (std::size_t t = 0; t < cell.triangles; ++t) {
          const auto& [a, b, c] = cell.edges[t];
          *out++ = {places[offsets[a]], places[offsets[b]], places[offsets[c]]};
        }
      }
    }
    return out;
  }

  // For each edge of a cell, where its vertex's index lies from corner 0's first place on.
  std::array<std::ptrdiff_t, 64> index_offsets(std::uint32_t y, std::uint32_t z) {
    const std::uint32_t* origin = rows_.indices(y, z);
    std::array<std::ptrdiff_t, 64> offsets;
    for (unsigned corner = 0; corner < 8; ++corner) {
      const std::ptrdiff_t row = rows_.indices(y + (corner >> 1 & 1), z + (corner >> 2)) - origin;
      for (unsigned direction = 0; direction < 8; ++direction) {
        offsets[edge_name(corner, direction)] =
            row + (corner & 1) * std::ptrdiff_t{kPlaces} + direction;
      }
    }
    return offsets;
  }

  const Extraction<T>& extraction_;
  const Lattice<T>& lattice_;
  const Dims dims_;
  const Slab slab_;
  Mesh& mesh_;
  SignWindow<T> signs_;
  RowRing rows_;
  std::vector<std::uint32_t> crossings_;  // of the row that is numbered
  std::size_t crossings_found_ = 0;
  std::array<std::array<EdgeFrame, 8>, 2> frames_ = {};  // by parity and direction
};

template <class T>
void count_slab_here(const Extraction<T>& extraction, const Slab& slab, SurfaceCount& count) {
  SignWindow<T> signs(extraction, slab.begin);
  for (std::uint32_t z = slab.begin; z < slab.end; ++z) {
    signs.reach(z);
    std::uint64_t vertices = 0;
    std::uint64_t triangles = 0;
    for (std::uint32_t y = 0; y < extraction.dims.y; ++y) {
      const CellRow row = signs.row(y, z);
      for (std::size_t w = 0; w < signs.words(); ++w) {
        if (!row.may_cross(w)) continue;
        const CornerWords corners = row.corners(w);
        for (const Word edges : row.crossed_edges(w, corners)) {
          vertices += static_cast<unsigned>(std::popcount(edges));
        }
        triangles += row.count_triangles(w, corners, extraction.splits);
      }
    }
    count.layer_vertices[z + 1] = vertices;
    count.layer_triangles[z + 1] = triangles;
  }
}

template <class T>
void write_slab_here(const Extraction<T>& extraction, const Slab& slab, IndexMemory& memory,
                     Mesh& mesh) {
  SlabWriter<T>(extraction, slab, memory, mesh).write();
}

}  // namespace

// Highway's tables hold functions, not templates.
#define ISOMESH_FOR_TYPE(T, Name, kType)                                                           \
  void count_slab_##Name(const Extraction<T>& extraction, const Slab& slab, SurfaceCount& count) { \
    count_slab_here(extraction, slab, count);                                                      \
  }                                                                                                \
  void write_slab_##Name(const Extraction<T>& extraction, const Slab& slab, IndexMemory& memory,   \
                         Mesh& mesh) {                                                             \
    write_slab_here(extraction, slab, memory, mesh);                                               \
  }
ISOMESH_FOR_EACH_SAMPLE_TYPE(ISOMESH_FOR_TYPE)
#undef ISOMESH_FOR_TYPE

}  // namespace isomesh::mesh::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace isomesh::mesh {

#define ISOMESH_DISPATCH(T, Name, kType)                                                    \
  HWY_EXPORT(count_slab_##Name);                                                            \
  HWY_EXPORT(write_slab_##Name);                                                            \
  template <>                                                                               \
  void count_slab(const Extraction<T>& extraction, const Slab& slab, SurfaceCount& count) { \
    HWY_DYNAMIC_DISPATCH(count_slab_##Name)(extraction, slab, count);                       \
  }                                                                                         \
  template <>                                                                               \
  void write_slab(const Extraction<T>& extraction, const Slab& slab, IndexMemory& memory,   \
                  Mesh& mesh) {                                                             \
    HWY_DYNAMIC_DISPATCH(write_slab_##Name)(extraction, slab, memory, mesh);                \
  }
ISOMESH_FOR_EACH_SAMPLE_TYPE(ISOMESH_DISPATCH)
#undef ISOMESH_DISPATCH

}  // namespace isomesh::mesh
#endif
