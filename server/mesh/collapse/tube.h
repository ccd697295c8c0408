// A surface T that carries two copies of itself, T+ inside S and T- outside; private to this
// folder. proof.h says why.
#pragma once

#include <array>
#include <cmath>
#include <cstdint>
#include <vector>

#include "server/mesh/collapse/vec.h"
#include "server/mesh/mesh.h"

namespace isomesh::mesh::collapse {

// Places in numbers of samples.
struct Vertex {
  Vecf p;
  Vecf in;   // in T+, where F > 0
  Vecf out;  // in T-, where F < 0
};

enum class Side { kIn, kOut };  // T+ or T-

// Seen from where T+ is, triangles are counter-clockwise.
struct Tube {
  std::vector<Vertex> vertices;
  std::vector<Triangle> triangles;
  std::vector<std::uint32_t> origins;  // of each vertex: a crossing of S that it came from
  std::vector<std::uint8_t> border;    // of each vertex: lies in a face of the volume, and stays
  std::vector<std::uint8_t> planes;    // of each vertex of a closed surface: the faces it stays in

  void add(const Vertex& vertex, std::uint32_t origin) {
    vertices.push_back(vertex);
    origins.push_back(origin);
    border.push_back(0);
    planes.push_back(0);
  }
  // Forgets the vertices that no triangle names, and puts the others in the order of their origins.
  void compact();
};

// All three places of a vertex lie on a grid of this many points to the voxel, so that differences
// of near ones are exact in single precision and areas in double.
inline constexpr float kPlaces = 65536;

inline Vecf snap(Vecd a) {
  const auto round = [](double x) {
    // Beside this number doubles are whole. std::nearbyint calls a function.
    constexpr double kWhole = 0x1.8p52;
    // Single precision has the nearest multiple, or of large numbers a coarser one.
    return static_cast<float>(((x * double{kPlaces} + kWhole) - kWhole) / double{kPlaces});
  };
  return {round(a.x), round(a.y), round(a.z)};
}

// The ends of a triangle that is wider than this are not told apart exactly.
inline constexpr float kWidest = 60;

// True if, at each corner, the vectors from T- to T and from T to T+ point to the triangle's front.
// T does not turn back over an edge between such triangles. `planes`: one bit for each face of the
// volume that all corners stay in: low x, high x, low y, ... If any is set, the front must face the
// inside of the volume.
inline bool is_upright(const Vertex& a, const Vertex& b, const Vertex& c, unsigned planes) {
  constexpr double kLeast = 1e-10;
  const Vecd normal = cross(wide(b.p - a.p), wide(c.p - a.p));
  if (planes != 0) {
    const double along = (planes & 0b000011) != 0   ? normal.x
                         : (planes & 0b001100) != 0 ? normal.y
                                                    : normal.z;
    return ((planes & 0b010101) != 0 ? along : -along) > kLeast;
  }
  const auto rises = [&](const Vertex& v) {
    return dot(normal, wide(v.in - v.p)) > kLeast && dot(normal, wide(v.p - v.out)) > kLeast;
  };
  return rises(a) && rises(b) && rises(c);
}

}  // namespace isomesh::mesh::collapse
