#include "tests/unit/mesh/bcc_reference.h"

#include <algorithm>
#include <cmath>
#include <functional>
#include <limits>
#include <map>
#include <type_traits>
#include <utility>

#include "proto/samples.h"
#include "server/mesh/extract/nearness.h"
#include "tests/support/points.h"
#include "tests/support/reference.h"
#include "tests/support/regular_reference.h"

namespace isomesh::test {
namespace {

using Name = std::array<int, 4>;  // record and slot

HalfCells plus(const HalfCells& a, const HalfCells& b, int times = 1) {
  return {a[0] + times * b[0], a[1] + times * b[1], a[2] + times * b[2]};
}

bool is_centre(const HalfCells& p) { return (p[0] & 1) != 0; }

HalfCells unit(std::size_t axis, int length) {
  HalfCells result = {0, 0, 0};
  result[axis] = length;
  return result;
}

int floor_half(int value) { return value >= 0 ? value / 2 : -((1 - value) / 2); }

using Corners = std::array<HalfCells, 4>;

bool has_centre(const HalfCells& centre, const HalfCells& cells) {
  for (std::size_t a = 0; a < 3; ++a) {
    if (centre[a] < 0 || centre[a] > 2 * cells[a]) return false;
  }
  return true;
}

// A pyramid over each face of the cell; two that share their base are cut together.
void visit_cell(const HalfCells& centre, const HalfCells& cells,
                const std::function<void(const Corners&)>& visit) {
  for (std::size_t axis = 0; axis < 3; ++axis) {
    const HalfCells second = unit((axis + 1) % 3, 1);
    const HalfCells third = unit((axis + 2) % 3, 1);
    for (const int side : {-1, 1}) {
      const HalfCells face = plus(centre, unit(axis, side));
      std::array<HalfCells, 4> base;
      for (std::size_t c = 0; c < 4; ++c) {
        base[c] = plus(plus(face, second, c == 1 || c == 2 ? 1 : -1), third, c > 1 ? 1 : -1);
      }
      const HalfCells other = plus(centre, unit(axis, 2 * side));
      if (!has_centre(other, cells)) {
        visit({centre, base[0], base[1], base[2]});
        visit({centre, base[0], base[2], base[3]});
      } else if (side > 0) {
        for (std::size_t c = 0; c < 4; ++c) visit({centre, other, base[c], base[(c + 1) % 4]});
      }
    }
  }
}

void visit_kuhn_cell(const HalfCells& low, const std::function<void(const Corners&)>& visit) {
  std::array<std::size_t, 3> axes = {0, 1, 2};
  do {
    Corners corners = {low, low, low, low};
    for (std::size_t n = 0; n < 3; ++n) corners[n + 1] = plus(corners[n], unit(axes[n], 2));
    visit(corners);
  } while (std::ranges::next_permutation(axes).found);
}

void for_each_tetrahedron(const HalfCells& cells, int margin,
                          const std::function<void(const Corners&)>& visit) {
  for (int z = -margin; z < cells[2] + margin; ++z) {
    for (int y = -margin; y < cells[1] + margin; ++y) {
      for (int x = -margin; x < cells[0] + margin; ++x) {
        const HalfCells centre = {2 * x + 1, 2 * y + 1, 2 * z + 1};
        if (has_centre(centre, cells)) {
          visit_cell(centre, cells, visit);
        } else {
          visit_kuhn_cell({2 * x, 2 * y, 2 * z}, visit);
        }
      }
    }
  }
}

// So that no coordinate is negative.
Sample shifted(const HalfCells& p, int margin) {
  Sample sample;
  for (std::size_t a = 0; a < 3; ++a) sample[a] = static_cast<std::uint32_t>(p[a] + 2 * margin);
  return sample;
}

// Those of all shifted points. Most tests ask for a few again and again.
const Stars& stars_of_bcc(const HalfCells& cells, int margin) {
  static std::map<std::pair<HalfCells, int>, Stars> known;
  const auto [place, is_new] = known.try_emplace({cells, margin});
  Stars& stars = place->second;
  if (!is_new) return stars;
  for_each_tetrahedron(cells, margin, [&](const Corners& corners) {
    std::array<Sample, 4> samples;
    for (std::size_t n = 0; n < 4; ++n) samples[n] = shifted(corners[n], margin);
    add_to_stars(samples, stars);
  });
  return stars;
}

template <class T>
class Enumeration {
 public:
  Enumeration(const mesh::Lattice<T>& lattice, const mesh::ExtractOptions& options)
      : lattice_(lattice),
        options_(options),
        margin_(options.close ? 1 : 0),
        cells_{static_cast<int>(lattice.dims.x) - 1, static_cast<int>(lattice.dims.y) - 1,
               static_cast<int>(lattice.dims.z) - 1} {}

  BccReference build() {
    for_each_tetrahedron(cells_, margin_, [&](const Corners& corners) { add(corners); });
    return numbered();
  }

  std::vector<std::uint32_t> clusters(const BccReference& reference) const {
    const auto back = [&](const Sample& sample) {
      HalfCells p;
      for (std::size_t a = 0; a < 3; ++a) p[a] = static_cast<int>(sample[a]) - 2 * margin_;
      return p;
    };
    std::vector<Crossing> crossings;
    for (const BccVertex& vertex : reference.vertices) {
      crossings.push_back({shifted(vertex.inside, margin_), shifted(vertex.outside, margin_)});
    }
    const double power = mesh::power_for(lattice_.samples, lattice_.dims.samples(), options_.iso);
    const auto distance = [&](const Sample& sample) {
      const HalfCells p = back(sample);
      if (options_.interpolation == Interpolation::kMidpoint) return 0.F;
      if (is_phantom(p)) return std::numeric_limits<float>::infinity();
      return static_cast<float>(
          std::abs(static_cast<double>(value(p)) * power - options_.iso * power));
    };
    const auto is_within = [&](const Sample& sample) {
      const HalfCells p = back(sample);
      for (std::size_t a = 0; a < 3; ++a) {
        if (p[a] < 2 || p[a] + 2 > 2 * cells_[a]) return false;
      }
      return true;
    };
    return joined_crossings({stars_of_bcc(cells_, margin_), crossings, distance, is_within});
  }

 private:
  using Edge = std::array<HalfCells, 2>;  // inside, outside

  bool is_phantom(const HalfCells& p) const {
    for (std::size_t a = 0; a < 3; ++a) {
      if (p[a] < 0 || p[a] > 2 * cells_[a]) return true;
    }
    return false;
  }

  T sample(int x, int y, int z) const {
    const auto& dims = lattice_.dims;
    return lattice_
        .samples[(static_cast<std::size_t>(z) * dims.y + static_cast<std::size_t>(y)) * dims.x +
                 static_cast<std::size_t>(x)];
  }

  // A mean of integers is exact; others are summed in double, in the order that lattices promise.
  long double value(const HalfCells& p) const {
    const int x = floor_half(p[0]);
    const int y = floor_half(p[1]);
    const int z = floor_half(p[2]);
    if (!is_centre(p)) return static_cast<long double>(sample(x, y, z));
    using Sum = std::conditional_t<std::is_integral_v<T>, long double, double>;
    const auto face = [&](int at, Sum scale) {
      const auto s = [&](int j, int k) {
        return scale * static_cast<Sum>(sample(at, y + j, z + k));
      };
      return (s(0, 0) + s(1, 0)) + (s(0, 1) + s(1, 1));
    };
    const Sum mean = (face(x, 1) + face(x + 1, 1)) / 8;
    if (!std::isfinite(mean)) {
      return static_cast<long double>(face(x, Sum{0.125}) + face(x + 1, Sum{0.125}));
    }
    return static_cast<long double>(mean);
  }

  bool is_inside(const HalfCells& p) const {
    return !is_phantom(p) && value(p) >= static_cast<long double>(options_.iso);
  }

  void add(const Corners& corners) {
    std::vector<HalfCells> in;
    std::vector<HalfCells> out;
    for (const HalfCells& p : corners) (is_inside(p) ? in : out).push_back(p);
    if (in.empty() || out.empty()) return;
    std::vector<Edge> edges;
    if (in.size() == 2) {
      edges = {{in[0], out[0]}, {in[0], out[1]}, {in[1], out[1]}, {in[1], out[0]}};
    } else {
      for (const HalfCells& a : in) {
        for (const HalfCells& b : out) edges.push_back({a, b});
      }
    }
    if (!faces_outside(edges, in, out)) std::reverse(edges.begin(), edges.end());
    std::vector<Name>& patch = patches_.emplace_back();
    for (const Edge& edge : edges) patch.push_back(name(edge));
  }

  Point middle(const std::vector<HalfCells>& points) const {
    Point sum = {0, 0, 0};
    for (const HalfCells& p : points) {
      for (std::size_t a = 0; a < 3; ++a) {
        sum[a] += p[a] / (2.0 * static_cast<double>(points.size()));
      }
    }
    return to_space(lattice_.to_space, sum);
  }

  bool faces_outside(const std::vector<Edge>& edges, const std::vector<HalfCells>& in,
                     const std::vector<HalfCells>& out) const {
    const auto at = [&](std::size_t n) { return middle({edges[n][0], edges[n][1]}); };
    return dot(cross(minus(at(1), at(0)), minus(at(2), at(0))), minus(middle(out), middle(in))) > 0;
  }

  // The lower end of the edge, or its centre, tells the record.
  Name name(const Edge& edge) {
    HalfCells low = std::min(edge[0], edge[1]);
    HalfCells high = std::max(edge[0], edge[1]);
    if (is_centre(high) && !is_centre(low)) std::swap(low, high);
    const HalfCells way = plus(high, low, -1);
    int slot = 0;
    const auto axes = 3 - std::ranges::count(way, 0);
    for (int a = 0; a < 3; ++a) {
      const int along = way[static_cast<std::size_t>(a)];
      if (is_centre(low) && !is_centre(high)) slot += along > 0 ? 1 << a : 0;
      if (axes == 1 && along != 0) slot = (is_centre(low) ? 11 : 8) + a;
      if (axes == 2 && along == 0) slot = 14 + a;
    }
    const Name result = {floor_half(low[2]), floor_half(low[1]), floor_half(low[0]), slot};
    edges_.emplace(result, edge);
    return result;
  }

  double fraction(const Edge& edge) const {
    if (is_phantom(edge[1])) return std::numeric_limits<double>::quiet_NaN();
    if (options_.interpolation == Interpolation::kMidpoint) return 0.5;
    return static_cast<double>((static_cast<long double>(options_.iso) - value(edge[0])) /
                               (value(edge[1]) - value(edge[0])));
  }

  bool is_on_border(const Edge& edge) const {
    if (!options_.close) return false;
    if (is_phantom(edge[1])) return true;
    for (std::size_t a = 0; a < 3; ++a) {
      const int at = edge[0][a];
      if (at == edge[1][a] && (at == 0 || at == 2 * cells_[a])) return true;
    }
    return false;
  }

  BccReference numbered() const {
    BccReference result;
    std::map<Name, std::uint32_t> numbers;
    for (const auto& [name, edge] : edges_) {
      numbers.emplace(name, static_cast<std::uint32_t>(numbers.size()));
      result.vertices.push_back({{name[0] + margin_, name[1] + margin_, name[2] + margin_},
                                 name[3],
                                 edge[0],
                                 edge[1],
                                 fraction(edge),
                                 is_on_border(edge)});
    }
    for (const auto& patch : patches_) {
      auto& corners = result.patches.emplace_back();
      for (const Name& name : patch) corners.push_back(numbers.at(name));
    }
    return result;
  }

  const mesh::Lattice<T>& lattice_;
  const mesh::ExtractOptions& options_;
  const int margin_;
  const HalfCells cells_;
  std::map<Name, Edge> edges_;
  std::vector<std::vector<Name>> patches_;
};

using Triangles = std::map<mesh::Triangle, int>;

mesh::Triangle turned(mesh::Triangle triangle) {
  std::rotate(triangle.begin(), std::ranges::min_element(triangle), triangle.end());
  return triangle;
}

bool take(Triangles& triangles, const std::vector<mesh::Triangle>& wanted) {
  for (const auto& triangle : wanted) {
    const auto found = triangles.find(turned(triangle));
    if (found == triangles.end() || found->second == 0) return false;
  }
  for (const auto& triangle : wanted) --triangles[turned(triangle)];
  return true;
}

testing::AssertionResult has_patches(const mesh::Mesh& mesh, const BccReference& reference) {
  if (mesh.triangles.size() != reference.triangles()) {
    return testing::AssertionFailure()
           << mesh.triangles.size() << " triangles, expected " << reference.triangles();
  }
  Triangles triangles;
  for (const mesh::Triangle& triangle : mesh.triangles) ++triangles[turned(triangle)];
  for (const auto& c : reference.patches) {
    const bool found = c.size() == 3
                           ? take(triangles, {{c[0], c[1], c[2]}})
                           : take(triangles, {{c[0], c[1], c[2]}, {c[0], c[2], c[3]}}) ||
                                 take(triangles, {{c[1], c[2], c[3]}, {c[1], c[3], c[0]}});
    if (!found) return testing::AssertionFailure() << "a patch at vertex " << c[0] << " is missing";
  }
  return testing::AssertionSuccess();
}

testing::AssertionResult has_layers(const mesh::Mesh& mesh, const BccReference& reference) {
  for (std::size_t v = 0; v < reference.vertices.size(); ++v) {
    const auto layer = static_cast<std::size_t>(reference.vertices[v].record[0]);
    if (v < mesh.layer_vertices[layer] || v >= mesh.layer_vertices[layer + 1]) {
      return testing::AssertionFailure() << "vertex " << v << " is not in layer " << layer;
    }
  }
  for (std::size_t k = 0; k < mesh.layers(); ++k) {
    for (const auto& triangle : mesh.triangles_of(k, k + 1)) {
      for (const std::uint32_t v : triangle) {
        if (k + 1 == mesh.layers() || v < mesh.layer_vertices[k] ||
            v >= mesh.layer_vertices[k + 2]) {
          return testing::AssertionFailure() << "layer " << k << " names vertex " << v;
        }
      }
    }
  }
  return testing::AssertionSuccess();
}

}  // namespace

std::uint64_t BccReference::triangles() const {
  std::uint64_t count = 0;
  for (const auto& patch : patches) count += patch.size() - 2;
  return count;
}

template <class T>
BccReference bcc_reference(const mesh::Lattice<T>& lattice, const mesh::ExtractOptions& options) {
  return Enumeration<T>(lattice, options).build();
}

template <class T>
std::vector<std::uint32_t> bcc_clusters(const mesh::Lattice<T>& lattice,
                                        const mesh::ExtractOptions& options,
                                        const BccReference& reference) {
  return Enumeration<T>(lattice, options).clusters(reference);
}

template <class T>
testing::AssertionResult matches(const mesh::Mesh& mesh, const BccReference& reference,
                                 const mesh::Lattice<T>& lattice) {
  if (mesh.positions.size() != reference.vertices.size()) {
    return testing::AssertionFailure()
           << mesh.positions.size() << " vertices, expected " << reference.vertices.size();
  }
  for (std::size_t v = 0; v < mesh.positions.size(); ++v) {
    const BccVertex& expected = reference.vertices[v];
    if (mesh.is_on_border(v) != expected.is_on_border) {
      return testing::AssertionFailure() << "vertex " << v << " is wrong about the border";
    }
    if (std::isnan(expected.fraction)) continue;
    // The rims of caps keep eight times the distance from samples.
    const double tolerance = (expected.is_on_border ? 16 : 2) * kEndMargin;
    Point at = {mesh.positions[v][0], mesh.positions[v][1], mesh.positions[v][2]};
    at = to_lattice(lattice.to_space, at);
    for (std::size_t a = 0; a < 3; ++a) {
      const double from = expected.inside[a] / 2.0;
      const double to = expected.outside[a] / 2.0;
      if (std::abs(from + (to - from) * expected.fraction - at[a]) > tolerance) {
        return testing::AssertionFailure()
               << "vertex " << v << " of slot " << expected.slot << " is elsewhere";
      }
    }
  }
  if (auto layers = has_layers(mesh, reference); !layers) return layers;
  return has_patches(mesh, reference);
}

#define ISOMESH_INSTANTIATE(T, name, kType)                                                  \
  template BccReference bcc_reference(const mesh::Lattice<T>&, const mesh::ExtractOptions&); \
  template std::vector<std::uint32_t> bcc_clusters(                                          \
      const mesh::Lattice<T>&, const mesh::ExtractOptions&, const BccReference&);            \
  template testing::AssertionResult matches(const mesh::Mesh&, const BccReference&,          \
                                            const mesh::Lattice<T>&);
ISOMESH_FOR_EACH_SAMPLE_TYPE(ISOMESH_INSTANTIATE)
#undef ISOMESH_INSTANTIATE

}  // namespace isomesh::test
