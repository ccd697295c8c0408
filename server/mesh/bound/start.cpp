#include "server/mesh/bound/start.h"

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <utility>

#include "server/mesh/bound/clear.h"
#include "server/mesh/parallel.h"

namespace isomesh::mesh::bound {
namespace {

constexpr std::size_t kChunk = 1 << 14;

std::size_t chunks_of(std::size_t count) { return (count + kChunk - 1) / kChunk; }

// Calls visit(i) for each of the chunk's numbers below `count`.
template <class Visit>
void visit_chunk(std::size_t chunk, std::size_t count, Visit visit) {
  for (std::size_t i = chunk * kChunk; i < std::min(count, (chunk + 1) * kChunk); ++i) visit(i);
}

bool is_in_face(const Dims& dims, const Vecd& a, const Vecd& b) {
  const auto share_face = [](double s, double t, std::uint32_t samples) {
    return s == t && (s == 0 || s == samples - 1.0);
  };
  return share_face(a.x, b.x, dims.x) || share_face(a.y, b.y, dims.y) ||
         share_face(a.z, b.z, dims.z);
}

// Puts a place of a closed surface's border into the faces that it is in but for rounding. Returns
// which those are, a bit each.
unsigned pin(const StartSurface& surface, Vecd& place) {
  const Field& field = surface.field;
  unsigned planes = 0;
  unsigned bit = 1;
  const auto pin_to = [&](double& coordinate, double plane) {
    if (std::abs(coordinate - plane) <= surface.rounding) {
      coordinate = plane;
      planes |= bit;
    }
    bit <<= 1;
  };
  const auto pin_along = [&](double& coordinate, std::uint32_t samples) {
    pin_to(coordinate, field.margin);
    pin_to(coordinate, samples - 1.0 - field.margin);
  };
  pin_along(place.x, field.dims.x);
  pin_along(place.y, field.dims.y);
  pin_along(place.z, field.dims.z);
  return planes;
}

// Where a vertex of the surface is, in numbers of samples.
Vecd place_of(const StartSurface& surface, std::size_t v) {
  const Vec3& at = surface.mesh.positions[v];
  Vecd place = surface.metric.index({at[0], at[1], at[2]});
  if (surface.mesh.is_on_border(v)) pin(surface, place);
  return place;
}

// T is where the vertex is, in a face of the volume, T+ nearer to the sample inside, and T-
// straight outward.
Vertex on_cap(const StartSurface& surface, std::size_t v) {
  Vecd place = place_of(surface, v);
  const unsigned planes = pin(surface, place);
  const auto outward = [&](unsigned first) {
    return static_cast<double>(planes >> (first + 1) & 1) -
           static_cast<double>(planes >> first & 1);
  };
  const Vecd way = {outward(0), outward(2), outward(4)};
  const auto along = [&](const Vecd& direction, double most) {
    const double long_mm = std::max(length(surface.metric.mm(direction)), 1e-9);
    return snap(place + direction * std::min(most, 0.5 * surface.reach_mm / long_mm));
  };
  const Vecd inside = surface.field.place(surface.crossings[v].inside);
  return {snap(place), along(inside - place, 1), along(way, 1e9)};
}

class Starter {
 public:
  Starter(const StartSurface& surface, const Clusters& clusters, const Context& context)
      : surface_(surface),
        field_(surface.field),
        crossings_(surface.crossings),
        metric_(surface.metric),
        clusters_(clusters),
        context_(context),
        vertex_(crossings_.size()),
        is_joined_(crossings_.size(), 0),
        stepped_(crossings_.size(), 0),
        changed_(crossings_.size(), 1),
        is_unclear_(crossings_.size(), 0) {}

  std::optional<Tube> run() {
    set_up();
    while (true) {
      find_changed_triangles();
      add_normals();
      place_changed_vertices();
      find_faults();
      if (!has_faults()) break;
      if (!step_back()) return {};
    }
    name_vertices();
    return std::move(tube_);
  }

 private:
  void set_up() {
    tube_.vertices.resize(crossings_.size());
    tube_.border.resize(crossings_.size());
    tube_.planes.resize(crossings_.size());
    tube_.triangles.assign(surface_.mesh.triangles.begin(), surface_.mesh.triangles.end());
    if (!metric_.is_left_handed()) {
      for (auto& [a, b, c] : tube_.triangles) std::swap(b, c);
    }
    normals_.resize(crossings_.size());
    parallel_for(context_, chunks_of(crossings_.size()), [&](std::size_t chunk) {
      visit_chunk(chunk, crossings_.size(), [&](std::size_t v) {
        const auto [inside, outside] = crossings_[v];
        tube_.border[v] = static_cast<std::uint8_t>(
            is_in_face(field_.dims, field_.place(inside), field_.place(outside)));
        stepped_[v] = tube_.border[v];
        vertex_[v] = static_cast<std::uint32_t>(v);
        if (surface_.mesh.is_on_border(v)) {
          Vecd place = place_of(surface_, v);
          tube_.planes[v] = static_cast<std::uint8_t>(pin(surface_, place));
        }
        place_alone(v);
      });
    });
    parallel_for(context_, chunks_of(clusters_.size()), [&](std::size_t chunk) {
      visit_chunk(chunk, clusters_.size(), [&](std::size_t k) { join(clusters_.members(k)); });
    });
    const std::size_t chunks = chunks_of(tube_.triangles.size());
    look_.resize(chunks);
    faults_.resize(chunks);
  }

  // Where a vertex is that no other is joined with.
  void place_alone(std::size_t v) {
    tube_.vertices[v] = on_lattice_edge(surface_, v);
    const bool is_elsewhere = surface_.is_moved || tube_.planes[v] != 0;
    if (is_elsewhere && stepped_[v] == 0) tube_.vertices[v].p = snap(place_of(surface_, v));
  }

  // Makes one vertex of crossings, at their mean.
  void join(std::span<const std::uint32_t> crossings) {
    Vecd sum = {};
    for (const std::uint32_t v : crossings) {
      vertex_[v] = crossings.front();
      sum = sum + (surface_.is_moved ? place_of(surface_, v) : zero_between(field_, crossings_[v]));
    }
    is_joined_[crossings.front()] = 1;
    tube_.vertices[crossings.front()].p = snap(sum * (1.0 / static_cast<double>(crossings.size())));
  }

  // The vertices of a triangle of S. Some of them are one where crossings are joined.
  Triangle corners(std::size_t t) const {
    const auto& [a, b, c] = tube_.triangles[t];
    return {vertex_[a], vertex_[b], vertex_[c]};
  }

  static bool is_empty(const Triangle& corners) {
    const auto& [a, b, c] = corners;
    return a == b || b == c || c == a;
  }

  void find_changed_triangles() {
    parallel_for(context_, look_.size(), [&](std::size_t chunk) {
      look_[chunk].clear();
      visit_chunk(chunk, tube_.triangles.size(), [&](std::size_t t) {
        const auto& [a, b, c] = tube_.triangles[t];
        const bool is_changed = (changed_[a] | changed_[b] | changed_[c]) != 0;
        if (is_changed && !is_empty(corners(t))) look_[chunk].push_back(t);
      });
    });
  }

  // All triangles around a changed vertex are looked at, so its sum is whole.
  void add_normals() {
    std::ranges::fill(normals_, Vecf{});
    for (const auto& chunk : look_) {
      for (const std::size_t t : chunk) {
        const auto& [a, b, c] = corners(t);
        const Vecf p = tube_.vertices[a].p;
        const Vecf normal =
            cross(metric_.mm(tube_.vertices[b].p - p), metric_.mm(tube_.vertices[c].p - p)) *
            metric_.turn();
        for (const std::uint32_t v : {a, b, c}) normals_[v] = normals_[v] + normal;
      }
    }
  }

  void place_changed_vertices() {
    parallel_for(context_, chunks_of(crossings_.size()), [&](std::size_t chunk) {
      Clear clear(field_);
      visit_chunk(chunk, crossings_.size(), [&](std::size_t v) {
        if (changed_[v] == 0 || vertex_[v] != v) return;
        Vertex& vertex = tube_.vertices[v];
        if (stepped_[v] != 0) {
          vertex = on_lattice_edge(surface_, v);
        } else {
          place_along_normal(clear, v);
        }
        is_unclear_[v] = static_cast<std::uint8_t>(!has_clear_ends(clear, vertex));
      });
    });
  }

  void place_along_normal(Clear& clear, std::size_t v) {
    Vertex& vertex = tube_.vertices[v];
    Vecd normal = wide(normals_[v]);
    if (!(length(normal) > 0)) {
      normal = metric_.mm(field_.place(crossings_[v].inside) - field_.place(crossings_[v].outside));
    }
    const Vecd way = metric_.steps(normal * (surface_.reach_mm / length(normal)));
    if (is_joined_[v] != 0 && !surface_.is_moved)
      vertex.p = nearer_to_surface(clear, vertex.p, way);
    vertex.in = snap(wide(vertex.p) + way);
    vertex.out = snap(wide(vertex.p) - way);
  }

  // The mean of crossings is off S. Most of a Newton step along `way`, which leads inside; the
  // whole of it leaves more triangles that are not upright.
  Vecf nearer_to_surface(Clear& clear, Vecf p, const Vecd& way) const {
    constexpr double kShare = 0.7;
    constexpr double kFarthest = 2;
    const Vecf inner = snap(wide(p) + way);
    const Vecf outer = snap(wide(p) - way);
    if (!clear.contains(inner) || !clear.contains(outer)) return p;
    clear.base(p);
    const double rise = clear.value(clear.at(inner)) - clear.value(clear.at(outer));
    if (!(rise > 0)) return p;
    const double step = -2 * clear.value(clear.at(p)) / rise;
    const Vecf nearer = snap(wide(p) + way * (kShare * std::clamp(step, -kFarthest, kFarthest)));
    return field_.margin == 0 || field_.encloses(nearer) ? nearer : p;
  }

  static bool has_clear_ends(Clear& clear, const Vertex& vertex) {
    if (!clear.contains(vertex.in) || !clear.contains(vertex.out)) return false;
    clear.base(vertex.in);
    return clear.point(clear.at(vertex.in), 1) && clear.point(clear.at(vertex.out), -1);
  }

  void find_faults() {
    parallel_for(context_, look_.size(), [&](std::size_t chunk) {
      Clear clear(field_);
      faults_[chunk].clear();
      for (const std::size_t t : look_[chunk]) {
        if (is_at_fault(clear, corners(t))) faults_[chunk].push_back(t);
      }
    });
  }

  bool is_at_fault(Clear& clear, const Triangle& triangle) const {
    const auto& [a, b, c] = triangle;
    if ((is_unclear_[a] | is_unclear_[b] | is_unclear_[c]) != 0) return true;
    const Vertex& x = tube_.vertices[a];
    const Vertex& y = tube_.vertices[b];
    const Vertex& z = tube_.vertices[c];
    const bool all_stepped = (stepped_[a] & stepped_[b] & stepped_[c]) != 0;
    const unsigned planes = tube_.planes[a] & tube_.planes[b] & tube_.planes[c];
    if (!all_stepped && !is_upright(x, y, z, planes)) return true;
    return !is_clear(clear, triangle, x.in, y.in, z.in, 1) ||
           !is_clear(clear, triangle, x.out, y.out, z.out, -1);
  }

  bool is_clear(Clear& clear, const Triangle& triangle, Vecf a, Vecf b, Vecf c, double sign) const {
    const auto is_mine = [&](std::uint32_t from, std::uint32_t to) {
      return from < to || (tube_.border[from] & tube_.border[to]) != 0;  // else the neighbour's
    };
    clear.base(a);
    const PlaneNumbers x = clear.at(a);
    const PlaneNumbers y = clear.at(b);
    const PlaneNumbers z = clear.at(c);
    return (!is_mine(triangle[0], triangle[1]) || clear.edge(x, y, sign)) &&
           (!is_mine(triangle[1], triangle[2]) || clear.edge(y, z, sign)) &&
           (!is_mine(triangle[2], triangle[0]) || clear.edge(z, x, sign)) &&
           clear.inside(x, y, z, sign);
  }

  bool has_faults() const {
    return std::ranges::any_of(faults_, [](const auto& chunk) { return !chunk.empty(); });
  }

  // Of each triangle at fault the vertex that is at fault in most of them. False where one has all
  // its vertices on lattice edges.
  bool step_back() {
    std::vector<std::uint32_t> count(crossings_.size(), 0);
    for (const auto& chunk : faults_) {
      for (const std::size_t t : chunk) {
        for (const std::uint32_t v : corners(t)) count[v] += stepped_[v] == 0 ? 1 : 0;
      }
    }
    std::ranges::fill(changed_, 0);
    for (const auto& chunk : faults_) {
      for (const std::size_t t : chunk) {
        const auto most = std::ranges::max(corners(t), {}, [&](std::uint32_t v) {
          return std::pair(count[v], crossings_.size() - v);
        });
        if (count[most] == 0) return false;
        changed_[most] = 1;
      }
    }
    for (std::size_t v = 0; v < changed_.size(); ++v) {
      if (is_joined_[v] == 0) stepped_[v] |= changed_[v];
    }
    for (std::size_t k = 0; k < clusters_.size(); ++k) {
      const std::uint32_t first = clusters_.members(k).front();
      if ((changed_[first] & is_joined_[first]) != 0) separate(clusters_.members(k));
    }
    return true;
  }

  void separate(std::span<const std::uint32_t> crossings) {
    is_joined_[crossings.front()] = 0;
    for (const std::uint32_t v : crossings) {
      vertex_[v] = v;
      changed_[v] = 1;
      place_alone(v);
    }
  }

  // Gives the tube its own triangles instead of those of S.
  void name_vertices() {
    std::size_t count = 0;
    for (std::size_t t = 0; t < tube_.triangles.size(); ++t) {
      const Triangle triangle = corners(t);
      if (!is_empty(triangle)) tube_.triangles[count++] = triangle;
    }
    tube_.triangles.resize(count);
  }

  const StartSurface& surface_;
  const Field& field_;
  const std::span<const Crossing> crossings_;
  const Metric& metric_;
  const Clusters& clusters_;
  const Context& context_;
  Tube tube_;  // while it is repaired, with the triangles of S
  std::vector<Vecf> normals_;
  std::vector<std::uint32_t> vertex_;  // of each crossing: the first crossing of its cluster
  std::vector<std::uint8_t>
      is_joined_;  // of the first crossings: whether the cluster is one vertex
  std::vector<std::uint8_t> stepped_, changed_, is_unclear_;  // by vertex
  std::vector<std::vector<std::size_t>> look_, faults_;       // by chunk of triangles
};

}  // namespace

Vertex on_lattice_edge(const StartSurface& surface, std::size_t vertex) {
  const auto& [field, crossings, metric, mesh, reach_mm, is_moved, rounding] = surface;
  const Crossing& crossing = crossings[vertex];
  if (field.margin != 0 && field.is_phantom(crossing.outside)) return on_cap(surface, vertex);
  const Vecd inside = field.place(crossing.inside);
  const Vecd outside = field.place(crossing.outside);
  const Vecd way = outside - inside;
  const double long_mm = length(metric.mm(way));
  const double zero = length(zero_between(field, crossing) - inside) / length(way);
  // At a sample near the iso-value many crossings lie in one place: T keeps off it.
  const double least = std::min(0.5, 0.5 * reach_mm / long_mm);
  const double share = std::clamp(zero, least, 1 - least);
  const Vecd p = inside + way * share;
  const double reach = reach_mm / long_mm;
  return {snap(p), snap(inside + way * std::max(0.0, share - reach)),
          snap(inside + way * std::min(1.0, share + reach))};
}

std::optional<Tube> make_start(const StartSurface& surface, const Clusters& clusters,
                               const Context& context) {
  return Starter(surface, clusters, context).run();
}

}  // namespace isomesh::mesh::bound
