#include "tests/support/scalar_surface.h"

#include <algorithm>
#include <cmath>
#include <iterator>
#include <limits>
#include <map>
#include <numeric>
#include <set>
#include <span>
#include <tuple>
#include <utility>

#include "tests/support/points.h"

namespace isomesh::test {
namespace {

using Corners = std::array<HalfCells, 4>;
using Edge = std::array<HalfCells, 2>;  // inside, outside
using Name = std::array<int, 4>;        // z, y, x of the owner in cells, and the slot there
using Points = std::set<HalfCells>;

HalfCells plus(HalfCells p, const HalfCells& way, int times = 1) {
  for (std::size_t a = 0; a < 3; ++a) p[a] += times * way[a];
  return p;
}

HalfCells axis_step(std::size_t axis, int length) {
  HalfCells step = {0, 0, 0};
  step[axis] = length;
  return step;
}

bool is_centre(const HalfCells& p) { return (p[0] & 1) != 0; }

std::int64_t axes_of(const HalfCells& way) { return 3 - std::ranges::count(way, 0); }

// The cell that begins at a sample, or that a centre is in: z, y, x.
std::array<int, 3> cell_of(const HalfCells& p) { return {p[2] >> 1, p[1] >> 1, p[0] >> 1}; }

// Table 1 of the paper, whose corners are numbered like this.
constexpr std::array<HalfCells, 8> kCorners = {
    {{0, 0, 0}, {2, 0, 0}, {2, 2, 0}, {0, 2, 0}, {0, 0, 2}, {2, 0, 2}, {2, 2, 2}, {0, 2, 2}}};
using TableRow = std::array<std::size_t, 4>;
constexpr std::array<TableRow, 6> kSix = {
    {{0, 2, 3, 6}, {0, 1, 2, 6}, {0, 1, 5, 6}, {0, 3, 6, 7}, {0, 4, 6, 7}, {0, 4, 5, 6}}};
constexpr std::array<TableRow, 5> kFive = {
    {{0, 2, 3, 7}, {0, 1, 2, 5}, {0, 4, 5, 7}, {2, 5, 6, 7}, {0, 2, 5, 7}}};

class ScalarWalk {
 public:
  ScalarWalk(const mesh::Lattice<double>& lattice, const mesh::ExtractOptions& options)
      : lattice_(lattice),
        options_(options),
        margin_(options.close ? 1 : 0),
        end_{2 * static_cast<int>(lattice.dims.x) - 2, 2 * static_cast<int>(lattice.dims.y) - 2,
             2 * static_cast<int>(lattice.dims.z) - 2},
        power_(power()) {}

  ScalarSurface build() {
    if (lattice_.dims.has_cells()) {
      visit_tetrahedra([&](const Corners& corners, int layer) { add(corners, layer); });
      if (options_.regularize) join_all();
    }
    return numbered();
  }

 private:
  bool is_phantom(const HalfCells& p) const {
    for (std::size_t a = 0; a < 3; ++a) {
      if (p[a] < 0 || p[a] > end_[a]) return true;
    }
    return false;
  }

  double sample(int x, int y, int z) const {
    const auto at = [](int i) { return static_cast<std::size_t>(i); };
    return lattice_.samples[(at(z) * lattice_.dims.y + at(y)) * lattice_.dims.x + at(x)];
  }

  // A centre has the mean of eight samples. Their order tells how floating point rounds.
  double value(const HalfCells& p) const {
    const auto [z, y, x] = cell_of(p);
    if (!is_centre(p)) return sample(x, y, z);
    const auto sum = [&, y = y, z = z](int at, double scale) {
      return (scale * sample(at, y, z) + scale * sample(at, y + 1, z)) +
             (scale * sample(at, y, z + 1) + scale * sample(at, y + 1, z + 1));
    };
    const double mean = (sum(x, 1) + sum(x + 1, 1)) / 8;
    return std::isfinite(mean) ? mean : sum(x, 0.125) + sum(x + 1, 0.125);
  }

  bool is_inside(const HalfCells& p) const { return !is_phantom(p) && options_.contains(value(p)); }

  bool has_centre(const HalfCells& centre) const {
    return options_.scheme == Scheme::kBcc && !is_phantom(centre);
  }

  // visit(corners, layer)
  template <class Visit>
  void visit_tetrahedra(Visit visit) const {
    const int low = -2 * margin_;
    for (int z = low; z < end_[2] - low; z += 2) {
      for (int y = low; y < end_[1] - low; y += 2) {
        for (int x = low; x < end_[0] - low; x += 2) {
          const auto visit_here = [&](const Corners& corners) { visit(corners, z / 2 + margin_); };
          has_centre({x + 1, y + 1, z + 1}) ? visit_faces({x + 1, y + 1, z + 1}, visit_here)
                                            : visit_cell({x, y, z}, visit_here);
        }
      }
    }
  }

  // Every other cell is mirrored if there are five.
  template <class Visit>
  void visit_cell(const HalfCells& low, Visit visit) const {
    const bool is_five = options_.scheme == Scheme::kFive;
    const bool is_mirrored = is_five && (low[0] + low[1] + low[2]) % 4 != 0;
    for (const TableRow& row : is_five ? std::span<const TableRow>(kFive) : kSix) {
      Corners corners;
      for (std::size_t n = 0; n < 4; ++n) {
        HalfCells way = kCorners[row[n]];
        if (is_mirrored) way[0] = 2 - way[0];
        corners[n] = plus(low, way);
      }
      visit(corners);
    }
  }

  // Four between two centres around the face that they share; two on a face of the border.
  template <class Visit>
  void visit_faces(const HalfCells& centre, Visit visit) const {
    for (std::size_t axis = 0; axis < 3; ++axis) {
      for (const int side : {-1, 1}) {
        const HalfCells face = plus(centre, axis_step(axis, side));
        Corners base;
        for (std::size_t c = 0; c < 4; ++c) {
          base[c] = plus(plus(face, axis_step((axis + 1) % 3, c == 1 || c == 2 ? 1 : -1)),
                         axis_step((axis + 2) % 3, c > 1 ? 1 : -1));
        }
        const HalfCells other = plus(centre, axis_step(axis, 2 * side));
        if (!has_centre(other)) {
          visit({centre, base[0], base[1], base[2]});
          visit({centre, base[0], base[2], base[3]});
        } else if (side > 0) {
          for (std::size_t c = 0; c < 4; ++c) visit({centre, other, base[c], base[(c + 1) % 4]});
        }
      }
    }
  }

  void add(const Corners& corners, int layer) {
    std::vector<HalfCells> in;
    std::vector<HalfCells> out;
    for (const HalfCells& p : corners) (is_inside(p) ? in : out).push_back(p);
    if (in.empty() || out.empty()) return;
    const bool turn = !faces_outside(in, out);
    const auto add_triangle = [&](const Edge& a, Edge b, Edge c) {
      if (turn) std::swap(b, c);
      triangles_.push_back({layer, {named(a), named(b), named(c)}});
    };
    if (in.size() == 2) {
      add_triangle({in[0], out[0]}, {in[0], out[1]}, {in[1], out[1]});
      add_triangle({in[0], out[0]}, {in[1], out[1]}, {in[1], out[0]});
    } else if (in.size() == 1) {
      add_triangle({in[0], out[0]}, {in[0], out[1]}, {in[0], out[2]});
    } else {
      add_triangle({in[0], out[0]}, {in[1], out[0]}, {in[2], out[0]});
    }
  }

  // True if the first triangle's normal points from inside to outside. Moving vertices along their
  // edges never flips it, so their middles tell.
  bool faces_outside(const std::vector<HalfCells>& in, const std::vector<HalfCells>& out) const {
    const auto at = [&](const HalfCells& a, const HalfCells& b) {
      return to_space(lattice_.to_space,
                      {(a[0] + b[0]) / 4.0, (a[1] + b[1]) / 4.0, (a[2] + b[2]) / 4.0});
    };
    const Point first = at(in[0], out[0]);
    const Point second = in.size() == 3 ? at(in[1], out[0]) : at(in[0], out[1]);
    const Point third = in.size() == 3   ? at(in[2], out[0])
                        : in.size() == 2 ? at(in[1], out[1])
                                         : at(in[0], out[2]);
    Point outwards = {0, 0, 0};
    for (const HalfCells& a : in) {
      for (const HalfCells& b : out) {
        const Point way = minus(at(b, b), at(a, a));
        for (std::size_t axis = 0; axis < 3; ++axis) outwards[axis] += way[axis];
      }
    }
    return dot(cross(minus(second, first), minus(third, first)), outwards) > 0;
  }

  // Of two samples the least along each axis is the owner, and the slot has a bit for each axis
  // along which they differ. On the body-centred lattice slots are those of bcc_faces.h.
  Name named(const Edge& edge) {
    const auto& [a, b] = edge;
    const HalfCells& from = is_centre(b) && (!is_centre(a) || b < a) ? b : a;
    const HalfCells& to = &from == &a ? b : a;
    HalfCells owner = from;
    int slot = 0;
    for (std::size_t axis = 0; axis < 3; ++axis) {
      if (!is_centre(from)) owner[axis] = std::min(a[axis], b[axis]);
      const bool is_set = is_centre(from) ? to[axis] > from[axis] : to[axis] != from[axis];
      slot |= is_set ? 1 << axis : 0;
    }
    if (options_.scheme == Scheme::kBcc && (!is_centre(from) || is_centre(to))) {
      constexpr std::array kOfSamples = {0, 8, 9, 16, 10, 15, 14, 0};
      slot = is_centre(from) ? 11 + slot / 2 : kOfSamples[static_cast<std::size_t>(slot)];
    }
    const auto [z, y, x] = cell_of(owner);
    const Name name = {z, y, x, slot};
    crossings_.emplace(name, edge);
    return name;
  }

  double share(const Edge& edge) const {
    if (is_phantom(edge[1])) return std::numeric_limits<double>::quiet_NaN();
    if (options_.interpolation == Interpolation::kMidpoint) return 0.5;
    // The difference of two large doubles can overflow.
    const long double from = value(edge[0]);
    return static_cast<double>((options_.iso - from) / (value(edge[1]) - from));
  }

  bool is_on_border(const Edge& edge) const {
    if (!options_.close) return false;
    if (is_phantom(edge[1])) return true;
    for (std::size_t a = 0; a < 3; ++a) {
      const int at = edge[0][a];
      if (at == edge[1][a] && (at == 0 || at == end_[a])) return true;
    }
    return false;
  }

  // The neighbours of a point, and of each those that are neighbours of both: its ring.
  using Star = std::map<HalfCells, Points>;

  struct Joining {
    std::map<HalfCells, Name> own;  // its crossings, by the other ends
    Points crossed;                 // the other ends of all
    Star star;
    std::vector<Points> candidates;
  };

  void join_all() {
    std::map<HalfCells, Joining> points;
    for (const auto& [name, edge] : crossings_) {
      for (std::size_t n = 0; n < 2; ++n) points[edge[n]].crossed.insert(edge[1 - n]);
      const float inside = distance(edge[0]);
      const float outside = distance(edge[1]);
      const std::size_t owner =
          inside < outside || (inside == outside && is_inside_first()) ? 0 : 1;
      points[edge[owner]].own[edge[1 - owner]] = name;
    }
    visit_tetrahedra([&](const Corners& corners, int) {
      for (const HalfCells& p : corners) {
        const auto found = points.find(p);
        if (found == points.end() || !may_join(p)) continue;
        for (const HalfCells& a : corners) {
          for (const HalfCells& b : corners) {
            if (a != p && b != p && a != b) found->second.star[a].insert(b);
          }
        }
      }
    });
    for (auto& [p, joining] : points) find_candidates(p, joining);
    for (const auto& [p, joining] : points) {
      for (const Points& component : joining.candidates) {
        if (!clashes(p, component, points)) join(p, component, joining);
      }
    }
  }

  // Points of at least the iso-value come before others that are equally near to it, so both sides
  // of a surface join the same crossings. Midpoints are equally near to all.
  bool is_inside_first() const {
    return options_.inside == Inside::kAbove || options_.interpolation == Interpolation::kMidpoint;
  }

  // From the iso-value.
  float distance(const HalfCells& p) const {
    if (options_.interpolation == Interpolation::kMidpoint) return 0;
    if (is_phantom(p)) return std::numeric_limits<float>::infinity();
    return static_cast<float>(std::abs(value(p) * power_ - options_.iso * power_));
  }

  // Distances that single precision cannot hold are multiplied: their median becomes about 1.
  double power() const {
    std::vector<int> exponents;
    const std::uint64_t count = lattice_.dims.samples();
    for (std::uint64_t n = 0; n < count; n += count / 4096 | 1) {
      const double distance = std::abs(lattice_.samples[n] - options_.iso);
      if (distance == 0) continue;
      exponents.push_back(std::isinf(distance) ? 1023 : std::ilogb(distance));
      if (std::abs(exponents.back()) <= 64) return 1;
    }
    if (exponents.empty()) return 1;
    std::ranges::sort(exponents);
    return std::ldexp(1.0, std::min(-exponents[exponents.size() / 2], 1023));
  }

  // First those to points that come later, along one axis before several.
  static auto rank(const HalfCells& p, const HalfCells& neighbour) {
    HalfCells way = plus(neighbour, p, -1);
    const bool is_later = std::tuple(way[2], way[1], way[0]) > std::tuple(0, 0, 0);
    if (!is_later) way = plus({0, 0, 0}, way, -1);
    return std::tuple(!is_later, axes_of(way), way);
  }

  static Points common(const Points& a, const Points& b) {
    Points both;
    std::ranges::set_intersection(a, b, std::inserter(both, both.end()));
    return both;
  }

  // Those of `all` that can be reached from `first` through `all`.
  static Points reached(const Star& star, const Points& all, const HalfCells& first) {
    Points found = {first};
    std::vector<HalfCells> open = {first};
    while (!open.empty()) {
      const HalfCells p = open.back();
      open.pop_back();
      for (const HalfCells& next : common(star.at(p), all)) {
        if (found.insert(next).second) open.push_back(next);
      }
    }
    return found;
  }

  static bool is_connected(const Star& star, const Points& all) {
    return reached(star, all, *all.begin()).size() == all.size();
  }

  // True if `some` of a ring are none, or one run with two others left.
  static bool is_run(const Star& star, const Points& ring, const Points& some) {
    return some.empty() || (is_connected(star, some) && some.size() + 2 <= ring.size());
  }

  // All neighbours of a point that joins crossings are points of the volume.
  bool may_join(const HalfCells& p) const {
    for (std::size_t a = 0; a < 3; ++a) {
      if (p[a] < 2 || p[a] + 2 > end_[a]) return false;
    }
    return true;
  }

  void find_candidates(const HalfCells& p, Joining& joining) const {
    if (!may_join(p)) return;
    Points rest;
    for (const auto& [other, name] : joining.own) rest.insert(other);
    while (!rest.empty()) {
      const HalfCells first = *std::ranges::min_element(
          rest, {}, [&](const HalfCells& other) { return rank(p, other); });
      const Points component = reached(joining.star, rest, first);
      for (const HalfCells& other : component) rest.erase(other);
      Points others;
      for (const auto& [neighbour, ring] : joining.star) {
        if (!component.contains(neighbour)) others.insert(neighbour);
      }
      bool joins = !others.empty() && is_connected(joining.star, others);
      for (const HalfCells& other : common(joining.crossed, others)) {
        const Points& ring = joining.star.at(other);
        joins = joins && is_run(joining.star, ring, common(ring, component));
      }
      if (joins) joining.candidates.push_back(component);
    }
  }

  bool clashes(const HalfCells& p, const Points& component,
               const std::map<HalfCells, Joining>& points) const {
    const Star& star = points.at(p).star;
    for (const auto& [neighbour, ring] : star) {
      const auto theirs = points.find(neighbour);
      const bool is_earlier = std::get<0>(rank(p, neighbour));
      if (theirs == points.end() || !is_earlier || is_inside(neighbour) != is_inside(p)) continue;
      for (const Points& other : theirs->second.candidates) {
        if (!is_run(star, ring, common(ring, common(component, other)))) return true;
      }
    }
    return false;
  }

  // A cluster's name comes before those of all edges of its row; samples' before centres'.
  void join(const HalfCells& p, const Points& component, const Joining& joining) {
    const auto [z, y, x] = cell_of(p);
    const std::array cluster = {z, y, is_centre(p) ? 1 : 0, x, cluster_count_++};
    for (const HalfCells& other : component) clusters_[joining.own.at(other)] = cluster;
  }

  ScalarSurface numbered() const {
    // By row; whether it is an edge, or else the kind of point; x; the slot, or the cluster.
    using Key = std::array<int, 5>;
    const auto key_of = [&](const Name& name) {
      const auto cluster = clusters_.find(name);
      return cluster != clusters_.end() ? cluster->second
                                        : Key{name[0], name[1], 2, name[2], name[3]};
    };
    std::map<Key, std::uint32_t> numbers;
    for (const auto& [name, edge] : crossings_) numbers[key_of(name)];
    ScalarSurface result;
    result.to_space = lattice_.to_space;
    result.dims = lattice_.dims;
    const std::size_t layers = lattice_.dims.z + 2 * static_cast<std::size_t>(margin_);
    result.layer_vertices.assign(layers + 1, 0);
    result.layer_triangles.assign(layers + 1, 0);
    for (auto& [key, number] : numbers) {
      number = static_cast<std::uint32_t>(result.vertices.size());
      const auto layer = static_cast<std::size_t>(key[0] + margin_);
      result.vertices.push_back({layer, {}});
      ++result.layer_vertices[layer + 1];
    }
    for (const auto& [name, edge] : crossings_) {
      result.becomes.push_back(numbers.at(key_of(name)));
      result.vertices[result.becomes.back()].crossings.push_back(
          {edge[0], edge[1], share(edge), is_on_border(edge)});
    }
    for (const auto& [layer, names] : triangles_) {
      mesh::Triangle corners;
      for (std::size_t n = 0; n < 3; ++n) corners[n] = numbers.at(key_of(names[n]));
      if (std::set(corners.begin(), corners.end()).size() < 3) continue;
      result.triangles.push_back(corners);
      ++result.layer_triangles[static_cast<std::size_t>(layer) + 1];
    }
    for (auto* sums : {&result.layer_vertices, &result.layer_triangles}) {
      std::partial_sum(sums->begin(), sums->end(), sums->begin());
    }
    return result;
  }

  const mesh::Lattice<double>& lattice_;
  const mesh::ExtractOptions& options_;
  const int margin_;     // layers of phantoms
  const HalfCells end_;  // the last sample
  const double power_;
  std::map<Name, Edge> crossings_;
  std::vector<std::pair<int, std::array<Name, 3>>> triangles_;  // layer, corners
  std::map<Name, std::array<int, 5>> clusters_;
  int cluster_count_ = 0;
};

}  // namespace

ScalarSurface scalar_surface(const mesh::Lattice<double>& lattice,
                             const mesh::ExtractOptions& options) {
  return ScalarWalk(lattice, options).build();
}

}  // namespace isomesh::test
