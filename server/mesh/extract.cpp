#include "server/mesh/extract.h"

#include <algorithm>
#include <array>
#include <functional>
#include <bit>
#include <cmath>
#include <limits>
#include <memory>
#include <numeric>
#include <optional>
#include <string>

#include "server/mesh/signs.h"
#include "server/mesh/tetrahedra.h"

namespace isomesh::mesh {
namespace {

using Offset = std::array<double, 3>;

// A run of layers that one task works on.
struct Slab {
  std::uint32_t begin = 0;
  std::uint32_t end = 0;
};

// Cuts the layers into runs of about equal cost; `cost(k)` is the running cost up to layer k.
template <class RunningCost>
std::vector<Slab> cut_slabs(std::uint32_t layers, std::size_t slabs, RunningCost cost) {
  std::vector<Slab> result;
  const double step = static_cast<double>(cost(layers)) / static_cast<double>(slabs);
  std::uint32_t begin = 0;
  for (std::uint32_t end = 1; end <= layers; ++end) {
    const double goal = step * static_cast<double>(result.size() + 1);
    if (end < layers && static_cast<double>(cost(end)) < goal) continue;
    result.push_back({begin, end});
    begin = end;
  }
  return result;
}

// Enough slabs that the threads end together, few enough that the plane which two slabs both number
// costs little.
std::size_t slab_count() { return static_cast<std::size_t>(thread_count()) * 6; }

// The signs of the planes around the one that is worked on, each classified once as z rises.
template <class T>
class SignWindow {
 public:
  SignWindow(const Lattice<T>& lattice, T smallest, std::uint32_t first)
      : lattice_(lattice),
        smallest_(smallest),
        planes_{SignPlane(lattice.dims), SignPlane(lattice.dims), SignPlane(lattice.dims)},
        next_(first) {}

  std::size_t words() const { return planes_[0].words(); }

  // Classifies up to the plane above z. Afterwards rows of z - 1 and z can be asked for.
  void reach(std::uint32_t z) {
    for (; next_ <= z + 1 && next_ < lattice_.dims.z; ++next_) {
      classify(lattice_, next_, smallest_, planes_[next_ % kPlanes]);
    }
  }

  CellRow row(Scheme scheme, std::uint32_t y, std::uint32_t z) const {
    const std::uint32_t above = std::min(z + 1, lattice_.dims.z - 1);
    return {lattice_.dims, scheme, planes_[z % kPlanes], planes_[above % kPlanes], y, z};
  }

 private:
  static constexpr std::uint32_t kPlanes = 3;

  const Lattice<T>& lattice_;
  T smallest_;
  std::array<SignPlane, kPlanes> planes_;
  std::uint32_t next_;
};

struct LayerCount {
  std::uint64_t vertices = 0;
  std::uint64_t triangles = 0;
};

void count_row(const CellRow& row, std::size_t words, LayerCount& count) {
  for (std::size_t w = 0; w < words; ++w) {
    if (!row.may_cross(w)) continue;
    const CornerWords corners = row.corners(w);
    for (const Word edges : row.crossed_edges(w, corners)) {
      count.vertices += static_cast<unsigned>(std::popcount(edges));
    }
    count.triangles += row.count_triangles(w, corners);
  }
}

// The indices of the vertices that the samples of one plane own: sample s's vertices are numbered
// from first[s] in the order of their directions, which are the bits of directions[s]. Only samples
// that own vertices have valid entries.
struct VertexPlane {
  explicit VertexPlane(const Dims& dims)
      : first(std::make_unique_for_overwrite<std::uint32_t[]>(std::size_t{dims.x} * dims.y)),
        directions(std::make_unique_for_overwrite<std::uint8_t[]>(std::size_t{dims.x} * dims.y)) {}

  std::unique_ptr<std::uint32_t[]> first;
  std::unique_ptr<std::uint8_t[]> directions;
};

// For a set of directions and one of them: how many come before it.
constexpr auto kRank = [] {
  std::array<std::array<std::uint8_t, 8>, 256> rank = {};
  for (unsigned set = 0; set < 256; ++set) {
    for (unsigned direction = 0; direction < 8; ++direction) {
      rank[set][direction] =
          static_cast<std::uint8_t>(std::popcount(set & ((1U << direction) - 1)));
    }
  }
  return rank;
}();

// Where a vertex on an edge lies: between two samples, by their values.
class Placement {
 public:
  Placement(const ExtractOptions& options, const Dims& dims, const LatticeToSpace& to_space)
      : half_iso_(options.iso / 2),
        midpoint_(options.interpolation == Interpolation::kMidpoint),
        nearest_(nearest_share(dims, to_space)) {}

  // The share of the way from a sample of value `from` to one of value `to`. Halves, because the
  // difference of two doubles can overflow.
  double share(double from, double to) const {
    if (midpoint_) return 0.5;
    const double f = (half_iso_ - from / 2) / (to / 2 - from / 2);
    return std::min(std::max(f, nearest_), 1 - nearest_);
  }

 private:
  // A vertex on a sample that equals the iso-value would coincide with those on the sample's other
  // edges, and their triangles would have no area. So every vertex keeps a distance from the samples
  // that single precision still resolves, in units of the last place of the largest coordinate.
  // Along a coordinate axis one unit survives any rounding; oblique steps change all coordinates
  // by a part of it, and take four.
  static double nearest_share(const Dims& dims, const LatticeToSpace& to_space) {
    const double resolved =
        largest_coordinate(dims, to_space) * std::numeric_limits<float>::epsilon();
    const double units = is_axis_aligned(to_space) ? 1 : 4;
    const double distance = smallest_plane_distance(to_space);
    constexpr double kMost = 0.25;
    return distance > 0 ? std::min(units * resolved / distance, kMost) : kMost;
  }

  static double largest_coordinate(const Dims& dims, const LatticeToSpace& to_space) {
    double largest = 0;
    for (unsigned corner = 0; corner < 8; ++corner) {
      const double x = (corner & 1) != 0 ? dims.x - 1.0 : 0;
      const double y = (corner & 2) != 0 ? dims.y - 1.0 : 0;
      const double z = (corner & 4) != 0 ? dims.z - 1.0 : 0;
      for (std::size_t axis = 0; axis < 3; ++axis) {
        largest = std::max(largest, std::abs(to_space.origin[axis] + to_space.step_x[axis] * x +
                                             to_space.step_y[axis] * y + to_space.step_z[axis] * z));
      }
    }
    return largest;
  }

  static bool is_axis_aligned(const LatticeToSpace& to_space) {
    const auto along_one_axis = [](const Offset& step) {
      return std::ranges::count(step, 0.0) == 2;
    };
    return along_one_axis(to_space.step_x) && along_one_axis(to_space.step_y) &&
           along_one_axis(to_space.step_z);
  }

  static double smallest_plane_distance(const LatticeToSpace& to_space) {
    const auto area = [](const Offset& a, const Offset& b) {
      return std::hypot(a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2],
                        a[0] * b[1] - a[1] * b[0]);
    };
    const double volume = std::abs(to_space.determinant());
    return std::min({volume / area(to_space.step_y, to_space.step_z),
                     volume / area(to_space.step_z, to_space.step_x),
                     volume / area(to_space.step_x, to_space.step_y)});
  }

  double half_iso_;
  bool midpoint_;
  double nearest_;
};

// Writes the surface of one slab.
template <class T>
class SlabWriter {
 public:
  SlabWriter(const Lattice<T>& lattice, const ExtractOptions& options, T smallest,
             const Placement& placement, const Slab& slab, Mesh& mesh)
      : lattice_(lattice),
        scheme_(options.scheme),
        placement_(placement),
        slab_(slab),
        mesh_(mesh),
        signs_(lattice, smallest, slab.begin),
        planes_{VertexPlane(lattice.dims), VertexPlane(lattice.dims)},
        flipped_(lattice.to_space.determinant() < 0) {
    for (unsigned corner = 0; corner < 8; ++corner) {
      const unsigned x = corner & 1;
      const unsigned y = corner >> 1 & 1;
      const unsigned z = corner >> 2 & 1;
      plane_offset_[corner] = x + std::size_t{lattice.dims.x} * y;
      sample_offset_[corner] =
          plane_offset_[corner] + std::size_t{lattice.dims.x} * lattice.dims.y * z;
      for (std::size_t axis = 0; axis < 3; ++axis) {
        space_offset_[corner][axis] = lattice.to_space.step_x[axis] * x +
                                      lattice.to_space.step_y[axis] * y +
                                      lattice.to_space.step_z[axis] * z;
      }
    }
  }

  // The triangles of a layer name vertices of the plane above it too, so that plane is numbered
  // first. The plane above the slab is numbered only: its vertices are the next slab's to write.
  void write() {
    number_vertices(slab_.begin);
    for (std::uint32_t z = slab_.begin; z < slab_.end; ++z) {
      if (z + 1 < lattice_.dims.z) number_vertices(z + 1);
      write_triangles(z);
    }
  }

 private:
  void number_vertices(std::uint32_t z) {
    signs_.reach(z);
    VertexPlane& plane = planes_[z & 1];
    auto next = static_cast<std::uint32_t>(mesh_.layer_vertices[z]);
    for (std::uint32_t y = 0; y < lattice_.dims.y; ++y) {
      const CellRow row = signs_.row(scheme_, y, z);
      for (std::size_t w = 0; w < signs_.words(); ++w) {
        if (!row.may_cross(w)) continue;
        const std::array<Word, 8> crossed = row.crossed_edges(w, row.corners(w));
        const auto directions = transpose(crossed);
        Word owners = std::accumulate(crossed.begin(), crossed.end(), Word{0}, std::bit_or());
        for (; owners != 0; owners &= owners - 1) {
          const auto bit = static_cast<unsigned>(std::countr_zero(owners));
          const auto x = static_cast<std::uint32_t>(w * kWordBits + bit);
          const std::size_t sample = std::size_t{y} * lattice_.dims.x + x;
          plane.first[sample] = next;
          plane.directions[sample] = directions[bit];
          if (z < slab_.end) place_vertices(x, y, z, row.split(x), directions[bit], next);
          next += static_cast<unsigned>(std::popcount(directions[bit]));
        }
      }
    }
  }

  void place_vertices(std::uint32_t x, std::uint32_t y, std::uint32_t z, const CellSplit& split,
                      unsigned directions, std::uint32_t vertex) {
    const LatticeToSpace& map = lattice_.to_space;
    const T* sample =
        lattice_.samples + (std::size_t{z} * lattice_.dims.y + y) * lattice_.dims.x + x;
    Offset place;
    for (std::size_t axis = 0; axis < 3; ++axis) {
      place[axis] =
          map.origin[axis] + map.step_x[axis] * x + map.step_y[axis] * y + map.step_z[axis] * z;
    }
    for (; directions != 0; directions &= directions - 1, ++vertex) {
      const EdgeEnds ends = split.ends[static_cast<unsigned>(std::countr_zero(directions))];
      const double share =
          placement_.share(static_cast<double>(sample[sample_offset_[ends.from]]),
                           static_cast<double>(sample[sample_offset_[ends.to]]));
      const Offset& from = space_offset_[ends.from];
      const Offset& to = space_offset_[ends.to];
      for (std::size_t axis = 0; axis < 3; ++axis) {
        mesh_.positions[vertex][axis] =
            static_cast<float>(place[axis] + from[axis] + share * (to[axis] - from[axis]));
      }
    }
  }

  void write_triangles(std::uint32_t z) {
    Triangle* out = mesh_.triangles.data() + mesh_.layer_triangles[z];
    for (std::uint32_t y = 0; y + 1 < lattice_.dims.y; ++y) {
      const CellRow row = signs_.row(scheme_, y, z);
      for (std::size_t w = 0; w < signs_.words(); ++w) {
        if (!row.may_cross(w)) continue;
        const CornerWords corners = row.corners(w);
        Word cells = row.crossed_cells(w, corners);
        const auto cases = transpose(corners);
        for (; cells != 0; cells &= cells - 1) {
          const auto bit = static_cast<unsigned>(std::countr_zero(cells));
          const auto x = static_cast<std::uint32_t>(w * kWordBits + bit);
          const CellCase& cell = row.split(x).cases[cases[bit]];
          const std::size_t sample = std::size_t{y} * lattice_.dims.x + x;
          for (std::size_t t = 0; t < cell.triangles; ++t) {
            const auto& [a, b, c] = cell.edges[t];
            *out++ = flipped_ ? Triangle{vertex(z, sample, a), vertex(z, sample, c), vertex(z, sample, b)}
                              : Triangle{vertex(z, sample, a), vertex(z, sample, b), vertex(z, sample, c)};
          }
        }
      }
    }
  }

  // The index of the vertex on an edge of the cell whose corner 0 is that sample of plane z.
  std::uint32_t vertex(std::uint32_t z, std::size_t sample, EdgeName edge) const {
    const unsigned corner = edge >> 3;
    const VertexPlane& plane = planes_[(z + (corner >> 2)) & 1];
    const std::size_t owner = sample + plane_offset_[corner];
    return plane.first[owner] + kRank[plane.directions[owner]][edge & 7];
  }

  const Lattice<T>& lattice_;
  const Scheme scheme_;
  const Placement& placement_;
  const Slab slab_;
  Mesh& mesh_;
  SignWindow<T> signs_;
  std::array<VertexPlane, 2> planes_;
  const bool flipped_;  // a left-handed lattice turns the tables' triangles inside out
  std::array<std::size_t, 8> plane_offset_ = {};   // of a cell's corners in a plane,
  std::array<std::size_t, 8> sample_offset_ = {};  // among the samples,
  std::array<Offset, 8> space_offset_ = {};        // and in millimetres
};

}  // namespace

template <class T>
SurfaceCount count_surface(const Lattice<T>& lattice, const ExtractOptions& options,
                           const Context& context) {
  const std::uint32_t layers = lattice.dims.z;
  SurfaceCount count;
  count.layer_vertices.assign(std::size_t{layers} + 1, 0);
  count.layer_triangles.assign(std::size_t{layers} + 1, 0);
  const auto smallest = smallest_inside<T>(options.iso);
  if (!lattice.dims.has_cells() || !smallest) {
    context.throw_if_stopped();
    return count;
  }

  const auto slabs = cut_slabs(layers, slab_count(), [](std::uint32_t z) { return z; });
  parallel_for(context, slabs.size(), [&](std::size_t task) {
    SignWindow<T> signs(lattice, *smallest, slabs[task].begin);
    for (std::uint32_t z = slabs[task].begin; z < slabs[task].end; ++z) {
      signs.reach(z);
      LayerCount layer;
      for (std::uint32_t y = 0; y < lattice.dims.y; ++y) {
        count_row(signs.row(options.scheme, y, z), signs.words(), layer);
      }
      count.layer_vertices[z + 1] = layer.vertices;
      count.layer_triangles[z + 1] = layer.triangles;
    }
  });
  for (auto* sums : {&count.layer_vertices, &count.layer_triangles}) {
    std::partial_sum(sums->begin(), sums->end(), sums->begin());
  }
  return count;
}

template <class T>
void extract_surface(const Lattice<T>& lattice, const ExtractOptions& options,
                     const SurfaceCount& count, const Context& context, Mesh& mesh) {
  constexpr std::uint64_t kMostVertices = std::numeric_limits<std::uint32_t>::max();
  if (count.vertices() > kMostVertices) {
    throw Error(ErrorCode::kTooLarge,
                "the surface has " + std::to_string(count.vertices()) +
                    " vertices; more than " + std::to_string(kMostVertices) +
                    " cannot be indexed with 32 bits");
  }
  mesh.origin = lattice.to_space.origin;
  mesh.layer_vertices = count.layer_vertices;
  mesh.layer_triangles = count.layer_triangles;
  mesh.positions.resize_for_overwrite(count.vertices());
  mesh.triangles.resize_for_overwrite(count.triangles());
  const auto smallest = smallest_inside<T>(options.iso);
  if (!lattice.dims.has_cells() || !smallest || count.vertices() == 0) {
    return context.throw_if_stopped();
  }

  const Placement placement(options, lattice.dims, lattice.to_space);
  // A layer costs its triangles, and its samples even when it is empty.
  const std::uint64_t samples_cost = std::uint64_t{lattice.dims.x} * lattice.dims.y / 16;
  const auto slabs = cut_slabs(lattice.dims.z, slab_count(), [&](std::uint32_t z) {
    return count.layer_triangles[z] + z * samples_cost;
  });
  parallel_for(context, slabs.size(), [&](std::size_t task) {
    SlabWriter<T>(lattice, options, *smallest, placement, slabs[task], mesh).write();
  });
}

#define ISOMESH_INSTANTIATE(T)                                                              \
  template SurfaceCount count_surface(const Lattice<T>&, const ExtractOptions&,             \
                                      const Context&);                                      \
  template void extract_surface(const Lattice<T>&, const ExtractOptions&,                   \
                                const SurfaceCount&, const Context&, Mesh&);
ISOMESH_INSTANTIATE(std::uint8_t)
ISOMESH_INSTANTIATE(std::int8_t)
ISOMESH_INSTANTIATE(std::uint16_t)
ISOMESH_INSTANTIATE(std::int16_t)
ISOMESH_INSTANTIATE(std::uint32_t)
ISOMESH_INSTANTIATE(std::int32_t)
ISOMESH_INSTANTIATE(float)
ISOMESH_INSTANTIATE(double)
#undef ISOMESH_INSTANTIATE

}  // namespace isomesh::mesh
