#include "server/mesh/measure/cavities.h"

#include <algorithm>
#include <cstdint>
#include <iterator>
#include <vector>

#include "server/mesh/measure/triangle_grid.h"
#include "server/mesh/parallel.h"
#include "server/mesh/points.h"

namespace isomesh::mesh {
namespace {

// A number for each directed edge; the opposite direction has the negative number, modulo 2^64.
// Over the edges of a component's triangles the sum is 0 if each edge is used equally often in both
// directions. Otherwise it is 0 with a probability of 2^-64.
std::uint64_t edge_number(std::uint32_t from, std::uint32_t to) {
  std::uint64_t mixed = (std::uint64_t{std::min(from, to)} << 32 | std::max(from, to)) + 1;
  // The finaliser of splitmix64 (G. L. Steele et al., OOPSLA 2014).
  mixed = (mixed ^ (mixed >> 30)) * 0xBF58476D1CE4E5B9U;
  mixed = (mixed ^ (mixed >> 27)) * 0x94D049BB133111EBU;
  mixed ^= mixed >> 31;
  return from < to ? mixed : 0 - mixed;
}

struct Shell {
  std::uint64_t open_edges = 0;  // the sum of edge_number
  double volume_mm3 = 0;         // of a closed component; the sum of tetrahedra to `apex`
  Point apex = {0, 0, 0};
  std::uint32_t first_triangle = TriangleGrid::kNone;
};

std::vector<Shell> shells_of(const Components& components, const Mesh& mesh) {
  std::vector<Shell> shells(components.count);
  for (std::uint32_t t = 0; t < mesh.triangles.size(); ++t) {
    const auto& [a, b, c] = mesh.triangles[t];
    Shell& shell = shells[components.of_vertex[a]];
    if (shell.first_triangle == TriangleGrid::kNone) {
      shell.first_triangle = t;
      shell.apex = to_point(mesh.positions[a]);
    }
    shell.open_edges += edge_number(a, b) + edge_number(b, c) + edge_number(c, a);
    const Point from = minus(to_point(mesh.positions[a]), shell.apex);
    shell.volume_mm3 += dot(from, cross(minus(to_point(mesh.positions[b]), shell.apex),
                                        minus(to_point(mesh.positions[c]), shell.apex))) /
                        6;
  }
  return shells;
}

// A point of the triangle, seldom in line with vertices.
Point point_in(const Mesh& mesh, const Triangle& triangle) {
  constexpr std::array<double, 3> kWeights = {0.2718281828, 0.3141592654, 0.4140125518};
  Point point = {0, 0, 0};
  for (std::size_t corner = 0; corner < 3; ++corner) {
    for (std::size_t axis = 0; axis < 3; ++axis) {
      point[axis] += kWeights[corner] * mesh.positions[triangle[corner]][axis];
    }
  }
  return point;
}

// Twice the area of the triangle (a, b, point) in the yz-plane.
double area_at(const Point& a, const Point& b, const Point& point) {
  return (b[1] - a[1]) * (point[2] - a[2]) - (b[2] - a[2]) * (point[1] - a[1]);
}

// 1 if the edge passes the point at a larger y while z increases, -1 while z decreases. A point in
// the plane of many triangles is in line with their edges. Vertices with its own z count as below
// it, and edges through it as at a smaller y. So it is in one of the triangles beside an edge.
int passes(const Point& from, const Point& to, const Point& point) {
  if ((from[2] > point[2]) == (to[2] > point[2])) return 0;
  const bool is_rising = to[2] > point[2];
  const Point& low = is_rising ? from : to;
  const Point& high = is_rising ? to : from;
  if (!(area_at(low, high, point) > 0)) return 0;
  return is_rising ? 1 : -1;
}

// The triangle's x where the ray in +x from the point meets it.
double x_at(const Point& a, const Point& b, const Point& c, const Point& point) {
  const double at_a = area_at(b, c, point);
  const double at_b = area_at(c, a, point);
  const double at_c = area_at(a, b, point);
  const double all = at_a + at_b + at_c;
  return all == 0 ? a[0] : (at_a * a[0] + at_b * b[0] + at_c * c[0]) / all;
}

// How often the ray from the point in +x leaves the walls minus how often it enters them; 0 if the
// point is in no cavity.
int crossings(const Point& point, const TriangleGrid& walls, double end_x,
              std::vector<std::uint32_t>& near) {
  near.clear();
  const Point end = {end_x, point[1], point[2]};
  walls.visit_along(point, end, [&](std::uint32_t triangle) { near.push_back(triangle); });
  std::ranges::sort(near);
  near.erase(std::unique(near.begin(), near.end()), near.end());
  int sum = 0;
  for (const std::uint32_t t : near) {
    const Triangle& triangle = walls.surface().triangles[t];
    const Point a = to_point(walls.surface().positions[triangle[0]]);
    const Point b = to_point(walls.surface().positions[triangle[1]]);
    const Point c = to_point(walls.surface().positions[triangle[2]]);
    const int turns = passes(a, b, point) + passes(b, c, point) + passes(c, a, point);
    if (turns != 0 && x_at(a, b, c, point) > point[0]) sum += turns;
  }
  return sum;
}

}  // namespace

Dropped fill_cavities(const Context& context, Mesh& mesh) {
  const Context quiet = {context.stop, nullptr};
  Components components;
  find_components(mesh, quiet, components);
  const std::vector<Shell> shells = shells_of(components, mesh);
  const auto is_wall = [&](std::uint32_t n) {
    return shells[n].open_edges == 0 && shells[n].volume_mm3 < 0;
  };
  const auto is_of_wall = [&](const Triangle& triangle) {
    return is_wall(components.of_vertex[triangle[0]]);
  };
  std::vector<Triangle> triangles;
  triangles.reserve(static_cast<std::size_t>(std::ranges::count_if(mesh.triangles, is_of_wall)));
  std::ranges::copy_if(mesh.triangles, std::back_inserter(triangles), is_of_wall);
  if (triangles.empty()) return {};
  const TriangleGrid walls({mesh.positions.span(), triangles}, quiet);
  float end_x = -std::numeric_limits<float>::infinity();
  for (const Triangle& triangle : triangles) {
    for (const std::uint32_t vertex : triangle) end_x = std::max(end_x, mesh.positions[vertex][0]);
  }

  std::vector<std::uint8_t> stays(shells.size(), 0);
  const auto find_shells = [&](std::size_t begin, std::size_t end) {
    std::vector<std::uint32_t> near;
    for (std::size_t n = begin; n < end; ++n) {
      const Shell& shell = shells[n];
      if (is_wall(static_cast<std::uint32_t>(n))) continue;
      if (shell.first_triangle == TriangleGrid::kNone) continue;  // a vertex of no triangle
      const Point point = point_in(mesh, mesh.triangles[shell.first_triangle]);
      stays[n] = point[0] > end_x || crossings(point, walls, end_x, near) == 0 ? 1 : 0;
    }
  };
  constexpr std::size_t kPerTask = 256;
  for_chunks(context, shells.size(), find_shells, kPerTask);
  context.throw_if_stopped();
  return leave_out({stays.begin(), stays.end()}, triangles_of(components, mesh), components, mesh);
}

std::uint64_t filling_memory(std::uint64_t vertices, std::uint64_t triangles) {
  constexpr std::uint64_t kGrid = 100;        // triangle_grid.h
  constexpr std::uint64_t kLeastOfShell = 3;  // vertices
  constexpr std::uint64_t kOfShell = sizeof(Shell) + sizeof(std::uint64_t) + 2;
  return triangles * (sizeof(Triangle) + kGrid) +
         vertices * (sizeof(std::uint32_t) + kOfShell / kLeastOfShell + 1);
}

}  // namespace isomesh::mesh
