#include "server/mesh/collapse/start.h"

#include <algorithm>
#include <atomic>
#include <cstddef>
#include <cstdint>
#include <numeric>
#include <utility>

#include "server/mesh/collapse/faults.h"
#include "server/mesh/parallel.h"

namespace isomesh::mesh::collapse {
namespace {

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

// The position of a vertex of the surface, in numbers of samples.
Vecd place_of(const StartSurface& surface, std::size_t v) {
  const Vec3& at = surface.mesh.positions[v];
  Vecd place = surface.metric.index({at[0], at[1], at[2]});
  if (surface.mesh.is_on_border(v)) pin(surface, place);
  return place;
}

// The place on the edge from the sample inside to the one next to the phantom, which a vertex of a
// cap gives way from (border.h).
Vecd before_it_gave_way(const Field& field, const Crossing& crossing, const Vecd& place) {
  const Vecd inside = field.place(crossing.inside);
  const Vecd phantom = field.place(crossing.outside);
  const auto within = [&](double coordinate, std::uint32_t samples) {
    return std::clamp<double>(coordinate, field.margin, samples - 1.0 - field.margin);
  };
  const Vecd edge = Vecd{within(phantom.x, field.dims.x), within(phantom.y, field.dims.y),
                         within(phantom.z, field.dims.z)} -
                    inside;
  const double squares = dot(edge, edge);
  return squares > 0 ? inside + edge * (dot(place - inside, edge) / squares) : inside;
}

// T is where the vertex is, in a face of the volume, T+ nearer to the sample inside, and T-
// straight outward. Beside the edge that the vertex gives way from, F may be negative.
Vertex on_cap(const StartSurface& surface, std::size_t v) {
  Vecd place = place_of(surface, v);
  const unsigned planes = pin(surface, place);
  const auto outward = [&](unsigned first) {
    return static_cast<double>(planes >> (first + 1) & 1) -
           static_cast<double>(planes >> first & 1);
  };
  const Vecd way = {outward(0), outward(2), outward(4)};
  const auto along = [&](const Vecd& from, const Vecd& direction, double most) {
    const double long_mm = std::max(length(surface.metric.mm(direction)), 1e-9);
    return snap(from + direction * std::min(most, 0.5 * surface.reach_mm / long_mm));
  };
  const Vecd on_edge = before_it_gave_way(surface.field, surface.crossings[v], place);
  const bool is_near = length(surface.metric.mm(on_edge - place)) < 0.25 * surface.reach_mm;
  const Vecd from = is_near ? on_edge : place;
  const Vecd inside = surface.field.place(surface.crossings[v].inside);
  return {snap(place), along(from, inside - from, 1), along(place, way, 1e9)};
}

constexpr std::uint32_t kNone = ~std::uint32_t{0};

// Vertices are those of the clusters, then those of crossings that no cluster has, then those of
// the crossings of clusters that were separated.
class Starter {
 public:
  Starter(const StartSurface& surface, const Clusters& clusters, const Context& context)
      : surface_(surface),
        field_(surface.field),
        metric_(surface.metric),
        clusters_(clusters),
        context_(context),
        layers_(surface.mesh.layer_triangles),
        vertex_(surface.crossings.size(), kNone),
        look_(layers_.size() - 1),
        faults_(layers_.size() - 1),
        start_{surface, tube_, vertex_, {}, {}} {}

  std::optional<Tube> run() {
    set_up();
    while (true) {
      start_.stepped = stepped_;
      find_changed_triangles();
      add_normals();
      place_changed_vertices();
      start_.is_unclear = is_unclear_;
      parallel_for(context_, look_.size(), [&](std::size_t layer) {
        faults_[layer].clear();
        find_faults(start_, look_[layer], faults_[layer]);
      });
      if (std::ranges::all_of(faults_, [](const auto& layer) { return layer.empty(); })) break;
      if (!step_back()) return {};
    }
    write_triangles();
    return std::move(tube_);
  }

 private:
  void set_up() {
    for_each(context_, clusters_.size(), [&](std::size_t k) {
      for (const std::uint32_t v : clusters_.members(k)) vertex_[v] = static_cast<std::uint32_t>(k);
    });
    std::vector<std::uint32_t> origins(clusters_.size());
    for (std::size_t k = 0; k < origins.size(); ++k) origins[k] = clusters_.members(k).front();
    for (std::uint32_t v = 0; v < vertex_.size(); ++v) {
      if (vertex_[v] != kNone) continue;
      vertex_[v] = static_cast<std::uint32_t>(origins.size());
      origins.push_back(v);
    }
    tube_.origins = std::move(origins);
    add_vertices(0);
  }

  bool is_joined(std::size_t v) const { return v < clusters_.size(); }

  // Gives the vertices from that one on what they have besides an origin.
  void add_vertices(std::size_t first) {
    const std::size_t count = tube_.origins.size();
    tube_.vertices.resize(count);
    tube_.border.resize(count, 0);
    tube_.planes.resize(count, 0);
    normals_.resize(count);
    stepped_.resize(count, 0);
    changed_.resize(count, 1);
    is_unclear_.resize(count, 0);
    for_each(context_, count - first, [&](std::size_t i) {
      const std::size_t v = first + i;
      if (is_joined(v)) {
        tube_.vertices[v].p = mean_of(clusters_.members(v));
      } else {
        place_alone(v);
      }
    });
  }

  Vecf mean_of(std::span<const std::uint32_t> crossings) const {
    Vecd sum = {};
    for (const std::uint32_t crossing : crossings) {
      sum = sum + (surface_.is_moved ? place_of(surface_, crossing)
                                     : zero_between(field_, surface_.crossings[crossing]));
    }
    return snap(sum * (1.0 / static_cast<double>(crossings.size())));
  }

  void place_alone(std::size_t v) {
    const std::uint32_t origin = tube_.origins[v];
    const auto [inside, outside] = surface_.crossings[origin];
    tube_.border[v] = static_cast<std::uint8_t>(
        is_in_face(field_.dims, field_.place(inside), field_.place(outside)));
    stepped_[v] = tube_.border[v];
    Vecd place = place_of(surface_, origin);
    if (surface_.mesh.is_on_border(origin)) {
      tube_.planes[v] = static_cast<std::uint8_t>(pin(surface_, place));
    }
    const bool is_elsewhere = surface_.is_moved || tube_.planes[v] != 0;
    tube_.vertices[v].p =
        is_elsewhere && stepped_[v] == 0 ? snap(place) : on_lattice_edge(surface_, origin).p;
  }

  static bool is_empty(const Triangle& corners) {
    const auto& [a, b, c] = corners;
    return a == b || b == c || c == a;
  }

  void find_changed_triangles() {
    parallel_for(context_, look_.size(), [&](std::size_t layer) {
      look_[layer].clear();
      for (std::uint64_t t = layers_[layer]; t < layers_[layer + 1]; ++t) {
        const Triangle corners = start_.corners(t);
        const auto& [a, b, c] = corners;
        if ((changed_[a] | changed_[b] | changed_[c]) == 0 || is_empty(corners)) continue;
        look_[layer].push_back(static_cast<std::uint32_t>(t));
      }
    });
  }

  // Calls body(layer) for every second layer at once and then for the others: triangles of two of
  // them have no vertex in common (mesh.h). So what they add to a vertex has one order.
  template <class Body>
  void for_layers(Body body) {
    for (const std::size_t odd : {0, 1}) {
      parallel_for(context_, (look_.size() + 1 - odd) / 2,
                   [&](std::size_t i) { body(2 * i + odd); });
    }
  }

  // All triangles around a changed vertex are looked at, so its sum is whole.
  void add_normals() {
    for_each(context_, normals_.size(), [&](std::size_t v) { normals_[v] = {}; });
    for_layers([&](std::size_t layer) {
      for (const std::uint32_t t : look_[layer]) {
        const auto& [a, b, c] = start_.corners(t);
        const Vecf p = tube_.vertices[a].p;
        const Vecf normal =
            cross(metric_.mm(tube_.vertices[b].p - p), metric_.mm(tube_.vertices[c].p - p)) *
            metric_.turn();
        for (const std::uint32_t v : {a, b, c}) normals_[v] = normals_[v] + normal;
      }
    });
  }

  void place_changed_vertices() {
    for_each(context_, tube_.vertices.size(), [&](std::size_t v) {
      if (changed_[v] == 0) return;
      if (stepped_[v] != 0) {
        tube_.vertices[v] = on_lattice_edge(surface_, tube_.origins[v]);
      } else {
        place_along_normal(v);
      }
      const Vertex& vertex = tube_.vertices[v];
      is_unclear_[v] = static_cast<std::uint8_t>(
          !(signed_value(vertex.in, 1) > kMargin && signed_value(vertex.out, -1) > kMargin));
    });
  }

  void place_along_normal(std::size_t v) {
    Vertex& vertex = tube_.vertices[v];
    Vecd normal = wide(normals_[v]);
    if (!(length(normal) > 0)) {
      const auto [inside, outside] = surface_.crossings[tube_.origins[v]];
      normal = metric_.mm(field_.place(inside) - field_.place(outside));
    }
    const Vecd way = metric_.steps(normal * (surface_.reach_mm / length(normal)));
    if (is_joined(v) && !surface_.is_moved) vertex.p = nearer_to_surface(vertex.p, way);
    vertex.in = snap(wide(vertex.p) + way);
    vertex.out = snap(wide(vertex.p) - way);
  }

  // The mean of crossings is off S. Most of a Newton step along `way`, which leads inside; the
  // whole of it leaves more triangles that are not upright.
  Vecf nearer_to_surface(Vecf p, const Vecd& way) const {
    constexpr double kShare = 0.7;
    constexpr double kFarthest = 2;
    const Vecf inner = snap(wide(p) + way);
    const Vecf outer = snap(wide(p) - way);
    if (!field_.contains(inner) || !field_.contains(outer)) return p;
    const double rise = value_at(field_, inner) - value_at(field_, outer);
    if (!(rise > 0)) return p;
    const double step = -2 * value_at(field_, p) / rise;
    const Vecf nearer = snap(wide(p) + way * (kShare * std::clamp(step, -kFarthest, kFarthest)));
    return field_.margin == 0 || field_.encloses(nearer) ? nearer : p;
  }

  // Negative outside of the volume, too.
  double signed_value(Vecf p, double sign) const {
    return field_.contains(p) ? sign * value_at(field_, p) : -1;
  }

  // For each triangle at fault, steps back its vertex that is at fault in most triangles. Returns
  // false if a triangle at fault has all its vertices on lattice edges.
  bool step_back() {
    std::vector<std::uint32_t> count(tube_.vertices.size(), 0);
    for_layers([&](std::size_t layer) {
      for (const std::uint32_t t : faults_[layer]) {
        for (const std::uint32_t v : start_.corners(t)) count[v] += stepped_[v] == 0 ? 1 : 0;
      }
    });
    std::ranges::fill(changed_, 0);
    std::atomic<bool> is_stuck = false;
    for_layers([&](std::size_t layer) {
      for (const std::uint32_t t : faults_[layer]) {
        const auto most = std::ranges::max(start_.corners(t), {}, [&](std::uint32_t v) {
          return std::pair(count[v], tube_.vertices.size() - v);
        });
        if (count[most] == 0) is_stuck = true;
        changed_[most] = 1;
      }
    });
    if (is_stuck) return false;
    const std::size_t before = tube_.vertices.size();
    for (std::size_t v = 0; v < before; ++v) {
      if (changed_[v] == 0) continue;
      if (is_joined(v)) {
        separate(clusters_.members(v));
      } else {
        stepped_[v] = 1;
      }
    }
    add_vertices(before);
    return true;
  }

  void separate(std::span<const std::uint32_t> crossings) {
    for (const std::uint32_t crossing : crossings) {
      vertex_[crossing] = static_cast<std::uint32_t>(tube_.origins.size());
      tube_.origins.push_back(crossing);
    }
  }

  void write_triangles() {
    std::vector<std::size_t> begin(look_.size() + 1, 0);
    const auto visit = [&](std::size_t layer, auto take) {
      for (std::uint64_t t = layers_[layer]; t < layers_[layer + 1]; ++t) {
        const Triangle corners = start_.corners(t);
        if (!is_empty(corners)) take(corners);
      }
    };
    parallel_for(context_, look_.size(), [&](std::size_t layer) {
      visit(layer, [&](const Triangle&) { ++begin[layer + 1]; });
    });
    std::partial_sum(begin.begin(), begin.end(), begin.begin());
    tube_.triangles.resize(begin.back());
    parallel_for(context_, look_.size(), [&](std::size_t layer) {
      std::size_t next = begin[layer];
      visit(layer, [&](const Triangle& corners) { tube_.triangles[next++] = corners; });
    });
  }

  const StartSurface& surface_;
  const Field& field_;
  const Metric& metric_;
  const Clusters& clusters_;
  const Context& context_;
  const std::span<const std::uint64_t> layers_;  // of the triangles of S
  Tube tube_;
  std::vector<std::uint32_t> vertex_;  // by crossing
  std::vector<Vecf> normals_;
  std::vector<std::uint8_t> stepped_, changed_, is_unclear_;  // by vertex
  std::vector<std::vector<std::uint32_t>> look_, faults_;     // triangles of S by layer
  TubeStart start_;
};

}  // namespace

Vertex on_lattice_edge(const StartSurface& surface, std::size_t vertex) {
  const auto& [field, crossings, metric, mesh, reach_mm, is_moved, rounding, turned] = surface;
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
  const Vecd at = inside + way * share;
  const Vecf p = snap(at);
  const double reach = (reach_mm - length(metric.mm(wide(p) - at))) / long_mm;
  return {p, snap(inside + way * std::max(0.0, share - reach)),
          snap(inside + way * std::min(1.0, share + reach))};
}

std::optional<Tube> make_start(const StartSurface& surface, const Clusters& clusters,
                               const Context& context) {
  return Starter(surface, clusters, context).run();
}

}  // namespace isomesh::mesh::collapse
