#include "tests/bench/paper.h"

#include <algorithm>
#include <array>
#include <utility>

namespace isomesh::bench {
namespace {

using Tetrahedron = std::array<unsigned, 4>;

// The paper's Table 1, corners numbered around the lower face and then around the upper one.
constexpr std::array<Tetrahedron, 6> kSixTetrahedra = {
    {{0, 2, 3, 6}, {0, 1, 2, 6}, {0, 1, 5, 6}, {0, 3, 6, 7}, {0, 4, 6, 7}, {0, 4, 5, 6}}};
constexpr std::array<Tetrahedron, 5> kFiveTetrahedra = {
    {{0, 2, 3, 7}, {0, 1, 2, 5}, {0, 4, 5, 7}, {2, 5, 6, 7}, {0, 2, 5, 7}}};
constexpr std::array<std::array<std::uint32_t, 3>, 8> kCorners = {
    {{0, 0, 0}, {1, 0, 0}, {1, 1, 0}, {0, 1, 0}, {0, 0, 1}, {1, 0, 1}, {1, 1, 1}, {0, 1, 1}}};

// A sample as a corner of a tetrahedron. Its place in the file orders the ends of an edge, so that
// an edge gives the same vertex to the bit in every tetrahedron.
struct Corner {
  std::size_t index;
  mesh::Vec3 position;
  double value;
};

class SoupMaker {
 public:
  explicit SoupMaker(const Surface& surface) : surface_(surface) {}

  void add(const std::array<Corner, 4>& corners) {
    std::array<const Corner*, 4> inside;
    std::array<const Corner*, 4> outside;
    std::size_t insides = 0;
    std::size_t outsides = 0;
    for (const Corner& corner : corners) {
      if (corner.value >= surface_.iso) {
        inside[insides++] = &corner;
      } else {
        outside[outsides++] = &corner;
      }
    }
    if (insides == 1) {
      soup_.push_back({vertex(*inside[0], *outside[0]), vertex(*inside[0], *outside[1]),
                       vertex(*inside[0], *outside[2])});
    } else if (insides == 3) {
      soup_.push_back({vertex(*inside[0], *outside[0]), vertex(*inside[1], *outside[0]),
                       vertex(*inside[2], *outside[0])});
    } else if (insides == 2) {
      const mesh::Vec3 a = vertex(*inside[0], *outside[0]);
      const mesh::Vec3 b = vertex(*inside[0], *outside[1]);
      const mesh::Vec3 c = vertex(*inside[1], *outside[1]);
      const mesh::Vec3 d = vertex(*inside[1], *outside[0]);
      soup_.push_back({a, b, c});
      soup_.push_back({a, c, d});
    }
  }

  Soup take() { return std::move(soup_); }

 private:
  mesh::Vec3 vertex(const Corner& one, const Corner& other) const {
    const auto& [from, to] = one.index < other.index
                                 ? std::pair<const Corner&, const Corner&>(one, other)
                                 : std::pair<const Corner&, const Corner&>(other, one);
    const double f = surface_.interpolation == Interpolation::kMidpoint
                         ? 0.5
                         : (surface_.iso - from.value) / (to.value - from.value);
    mesh::Vec3 result;
    for (std::size_t axis = 0; axis < 3; ++axis) {
      result[axis] = static_cast<float>(from.position[axis] +
                                        f * (double{to.position[axis]} - from.position[axis]));
    }
    return result;
  }

  const Surface surface_;
  Soup soup_;
};

// Looks vertices up and adds those that are new.
class VertexTables {
 public:
  VertexTables(const Soup& soup, std::size_t count, IndexedMesh& mesh) : mesh_(mesh) {
    mesh_.sub_tables.resize(count);
    if (soup.empty()) return;
    low_ = high_ = soup[0][0][0];
    for (const auto& triangle : soup) {
      for (const mesh::Vec3& corner : triangle) {
        low_ = std::min(low_, corner[0]);
        high_ = std::max(high_, corner[0]);
      }
    }
  }

  std::size_t table_of(const mesh::Vec3& position) const {
    const std::size_t count = mesh_.sub_tables.size();
    if (high_ <= low_) return 0;
    const float share = (position[0] - low_) / (high_ - low_);
    return std::min(static_cast<std::size_t>(share * static_cast<float>(count)), count - 1);
  }

  std::uint32_t vertex(const mesh::Vec3& position) {
    auto& entries = mesh_.sub_tables[table_of(position)].entries;
    const auto by_x = [](const IndexedMesh::Entry& entry, float x) {
      return entry.position[0] < x;
    };
    auto entry = std::lower_bound(entries.begin(), entries.end(), position[0], by_x);
    for (; entry != entries.end() && entry->position[0] == position[0]; ++entry) {
      if (entry->position == position) return entry->vertex;
    }
    const auto added = static_cast<std::uint32_t>(mesh_.vertices.size());
    entries.insert(entry, {position, added});
    mesh_.vertices.push_back(position);
    return added;
  }

 private:
  IndexedMesh& mesh_;
  float low_ = 0;
  float high_ = 0;
};

// Once into each of the up to three tables that its corners are in.
void list_triangle(const VertexTables& tables, const mesh::Triangle& triangle, IndexedMesh& mesh) {
  std::array<std::size_t, 3> homes;
  for (std::size_t i = 0; i < 3; ++i) homes[i] = tables.table_of(mesh.vertices[triangle[i]]);
  std::ranges::sort(homes);
  for (std::size_t i = 0; i < 3; ++i) {
    if (i > 0 && homes[i] == homes[i - 1]) continue;
    mesh.sub_tables[homes[i]].triangles.push_back(triangle);
  }
}

// Leaves each neighbour once, and none at all when one of them was named by a single triangle.
void settle(std::vector<std::uint32_t>& neighbors) {
  std::ranges::sort(neighbors);
  std::vector<std::uint32_t> unique;
  for (auto run = neighbors.begin(); run != neighbors.end();) {
    const auto end = std::find_if(run, neighbors.end(), [&](auto other) { return other != *run; });
    if (end - run == 1) {
      neighbors.clear();
      return;
    }
    unique.push_back(*run);
    run = end;
  }
  neighbors = std::move(unique);
}

}  // namespace

Soup extract_soup(const Samples& samples, const Surface& surface) {
  SoupMaker maker(surface);
  const mesh::Dims& dims = samples.dims;
  const Geometry& geometry = samples.geometry;
  const bool six = surface.scheme == Scheme::kSix;
  visit_samples(samples, [&](const auto* data) {
    for (std::uint32_t k = 0; k + 1 < dims.z; ++k) {
      for (std::uint32_t j = 0; j + 1 < dims.y; ++j) {
        for (std::uint32_t i = 0; i + 1 < dims.x; ++i) {
          const bool mirrored = !six && (i + j + k) % 2 == 1;
          std::array<Corner, 8> cell;
          for (std::size_t c = 0; c < cell.size(); ++c) {
            const std::uint32_t x = i + (mirrored ? 1 - kCorners[c][0] : kCorners[c][0]);
            const std::uint32_t y = j + kCorners[c][1];
            const std::uint32_t z = k + kCorners[c][2];
            const std::size_t index = (std::size_t{z} * dims.y + y) * dims.x + x;
            const auto along = [&](std::size_t axis, std::uint32_t step) {
              return static_cast<float>(geometry.origin[axis] + geometry.spacing[axis] * step);
            };
            cell[c] = {
                index, {along(0, x), along(1, y), along(2, z)}, static_cast<double>(data[index])};
          }
          const std::span<const Tetrahedron> split =
              six ? std::span<const Tetrahedron>(kSixTetrahedra)
                  : std::span<const Tetrahedron>(kFiveTetrahedra);
          for (const auto& [a, b, c, d] : split) maker.add({cell[a], cell[b], cell[c], cell[d]});
        }
      }
    }
  });
  return maker.take();
}

Soup soup_of(std::span<const mesh::Vec3> positions, std::span<const mesh::Triangle> triangles) {
  Soup soup;
  soup.reserve(triangles.size());
  for (const auto& [a, b, c] : triangles) {
    soup.push_back({positions[a], positions[b], positions[c]});
  }
  return soup;
}

double IndexedMesh::search_steps() const {
  double steps = 0;
  for (const SubTable& table : sub_tables) {
    steps +=
        static_cast<double>(table.entries.size()) * static_cast<double>(table.triangles.size());
  }
  return steps;
}

IndexedMesh find_unique(const Soup& soup, std::size_t sub_tables) {
  IndexedMesh mesh;
  VertexTables tables(soup, sub_tables, mesh);
  for (const auto& [a, b, c] : soup) {
    const mesh::Triangle triangle = {tables.vertex(a), tables.vertex(b), tables.vertex(c)};
    if (triangle[0] == triangle[1] || triangle[1] == triangle[2] || triangle[2] == triangle[0]) {
      continue;
    }
    mesh.triangles.push_back(triangle);
    list_triangle(tables, triangle, mesh);
  }
  return mesh;
}

NeighborLists find_neighbors(const IndexedMesh& mesh) {
  NeighborLists lists(mesh.vertices.size());
  for (const IndexedMesh::SubTable& table : mesh.sub_tables) {
    for (const IndexedMesh::Entry& entry : table.entries) {
      std::vector<std::uint32_t>& list = lists[entry.vertex];
      for (const auto& [a, b, c] : table.triangles) {
        if (a == entry.vertex) {
          list.insert(list.end(), {b, c});
        } else if (b == entry.vertex) {
          list.insert(list.end(), {c, a});
        } else if (c == entry.vertex) {
          list.insert(list.end(), {a, b});
        }
      }
      settle(list);
    }
  }
  return lists;
}

void smooth(const NeighborLists& neighbors, int passes, IndexedMesh& mesh) {
  std::vector<mesh::Vec3> moved = mesh.vertices;
  for (int pass = 0; pass < passes; ++pass) {
    for (std::size_t v = 0; v < moved.size(); ++v) {
      if (neighbors[v].empty()) continue;
      mesh::Vec3 sum = {0, 0, 0};
      for (const std::uint32_t neighbor : neighbors[v]) {
        for (std::size_t axis = 0; axis < 3; ++axis) sum[axis] += mesh.vertices[neighbor][axis];
      }
      for (std::size_t axis = 0; axis < 3; ++axis) {
        moved[v][axis] = sum[axis] / static_cast<float>(neighbors[v].size());
      }
    }
    std::swap(mesh.vertices, moved);
  }
}

}  // namespace isomesh::bench
