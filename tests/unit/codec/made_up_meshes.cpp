#include "tests/unit/codec/made_up_meshes.h"

#include <algorithm>
#include <array>
#include <limits>
#include <utility>

#include "server/mesh/extract/windows.h"
#include "server/mesh/smooth/smooth.h"
#include "tests/support/kernels.h"

namespace isomesh::test {
namespace {

class Bytes {
 public:
  explicit Bytes(std::span<const std::byte> bytes) : rest_(bytes) {}

  std::uint32_t next() {
    if (rest_.empty()) return 0;
    const auto value = static_cast<std::uint32_t>(rest_.front());
    rest_ = rest_.subspan(1);
    return value;
  }
  std::uint32_t below(std::uint32_t limit) { return (next() << 8 | next()) % limit; }
  float coordinate() { return static_cast<float>(below(60000)) / 977.0F; }
  mesh::Vec3 position() { return {coordinate(), coordinate(), coordinate()}; }

 private:
  std::span<const std::byte> rest_;
};

struct Parts {
  std::vector<mesh::Vec3> positions;
  std::vector<mesh::Triangle> triangles;

  std::uint32_t vertices() const { return static_cast<std::uint32_t>(positions.size()); }
};

mesh::Mesh mesh_of(const Parts& parts) {
  mesh::Mesh mesh;
  mesh.positions.resize_for_overwrite(parts.positions.size());
  std::ranges::copy(parts.positions, mesh.positions.begin());
  mesh.triangles.resize_for_overwrite(parts.triangles.size());
  std::ranges::copy(parts.triangles, mesh.triangles.begin());
  mesh.layer_vertices = {0, parts.positions.size()};
  mesh.layer_triangles = {0, parts.triangles.size()};
  return mesh;
}

// The surface in a little volume of noise, which may be smoothed.
mesh::Mesh noise_surface(Bytes& bytes) {
  const mesh::Dims dims = {2 + bytes.below(13), 2 + bytes.below(13), 2 + bytes.below(13)};
  const std::uint32_t options = bytes.next();
  std::vector<float> samples(dims.samples());
  for (float& sample : samples) {
    const float fresh = static_cast<float>(bytes.next());
    // Less noisy, so that pieces become larger.
    sample = (options & 8U) != 0 && &sample != samples.data() ? 0.7F * *(&sample - 1) + 0.3F * fresh
                                                              : fresh;
  }
  const mesh::Lattice<float> lattice = {samples.data(), dims, mesh::lattice_to_space({})};
  const mesh::ExtractOptions extraction = {
      .iso = 40.5 + bytes.below(170),
      .scheme = (options & 1U) != 0 ? Scheme::kFive : Scheme::kSix,
      .close = (options & 2U) != 0};
  mesh::Mesh mesh;
  mesh::SurfaceWindows(lattice, extraction, {}).write_whole({}, mesh);
  if ((options & 4U) != 0) mesh::smooth({.steps = test::means(2, {1})}, {}, mesh);
  return mesh;
}

// A sheet, a tube or a torus of squares with holes.
Parts sheet(Bytes& bytes, bool holes) {
  const bool round_x = bytes.next() % 2 != 0;
  const bool round_y = bytes.next() % 2 != 0;
  const std::uint32_t width = 3 + bytes.below(20);
  const std::uint32_t height = 3 + bytes.below(20);
  const std::uint32_t columns = width + (round_x ? 0 : 1);
  const std::uint32_t rows = height + (round_y ? 0 : 1);
  const std::uint32_t kept = holes ? 200 : 256;
  Parts parts;
  for (std::uint32_t i = 0; i < rows * columns; ++i) parts.positions.push_back(bytes.position());
  const auto at = [&](std::uint32_t x, std::uint32_t y) {
    return y % rows * columns + x % columns;
  };
  for (std::uint32_t y = 0; y < height; ++y) {
    for (std::uint32_t x = 0; x < width; ++x) {
      const std::uint32_t how = bytes.next();
      if (how >= kept) continue;
      const auto [a, b, c, d] = std::array{at(x, y), at(x + 1, y), at(x + 1, y + 1), at(x, y + 1)};
      if (how % 2 != 0) {
        parts.triangles.insert(parts.triangles.end(), {{a, b, c}, {a, c, d}});
      } else {
        parts.triangles.insert(parts.triangles.end(), {{a, b, d}, {b, c, d}});
      }
    }
  }
  return parts;
}

// Triangles, pairs of them back to back, tetrahedra, fans and strips.
Parts pieces(Bytes& bytes) {
  Parts parts;
  for (std::uint32_t count = 1 + bytes.below(400); count > 0; --count) {
    const std::uint32_t first = parts.vertices();
    const std::uint32_t kind = bytes.next() % 5;
    const std::uint32_t more = kind < 3 ? (kind == 2 ? 1 : 0) : 1 + bytes.next() % 20;
    for (std::uint32_t i = 0; i < 3 + more; ++i) parts.positions.push_back(bytes.position());
    const auto add = [&](std::uint32_t a, std::uint32_t b, std::uint32_t c) {
      parts.triangles.push_back({first + a, first + b, first + c});
    };
    if (kind == 2) {
      add(0, 2, 1), add(0, 1, 3), add(1, 2, 3), add(2, 0, 3);
      continue;
    }
    add(0, 1, 2);
    if (kind == 1) add(0, 2, 1);
    for (std::uint32_t i = 0; kind == 3 && i < more; ++i) add(0, i + 2, i + 3);
    for (std::uint32_t i = 0; kind == 4 && i < more; ++i) {
      i % 2 == 0 ? add(i + 2, i + 1, i + 3) : add(i + 1, i + 2, i + 3);
    }
  }
  return parts;
}

// Makes some vertices one.
Parts pinched(Parts parts, Bytes& bytes) {
  for (std::uint32_t count = 1 + bytes.next() % 8; count > 0; --count) {
    const std::uint32_t kept = bytes.below(parts.vertices());
    const std::uint32_t gone = bytes.below(parts.vertices());
    for (mesh::Triangle& triangle : parts.triangles) std::ranges::replace(triangle, gone, kept);
  }
  return parts;
}

Parts thrown_together(Bytes& bytes) {
  Parts parts;
  const std::uint32_t vertices = 1 + bytes.next() % 40;
  for (std::uint32_t i = 0; i < vertices; ++i) parts.positions.push_back(bytes.position());
  for (std::uint32_t count = bytes.next() % 100; count > 0; --count) {
    parts.triangles.push_back(
        {bytes.next() % vertices, bytes.next() % vertices, bytes.next() % vertices});
  }
  return parts;
}

// As those of a cut through a surface: some consecutive triangles, some of them turned.
void damage(mesh::Mesh& mesh, Bytes& bytes, MadeUpMesh& made) {
  if (mesh.positions.size() == 0 || mesh.triangles.size() == 0) return;
  const auto vertices = static_cast<std::uint32_t>(mesh.positions.size());
  const auto triangles = static_cast<std::uint32_t>(mesh.triangles.size());
  const std::uint32_t how = bytes.next();
  if (how % 8 == 1) {  // flat
    for (mesh::Vec3& position : mesh.positions) position[how / 8 % 3] = 7.25F;
  } else if (how % 8 == 2) {  // a triangle turned, or one that repeats a vertex
    mesh::Triangle& triangle = mesh.triangles[bytes.below(triangles)];
    how / 8 % 2 == 0 ? std::swap(triangle[0], triangle[1]) : void(triangle[0] = triangle[2]);
    made.is_manifold = false;
  } else if (how % 8 == 3) {
    constexpr std::array kBad = {std::numeric_limits<float>::quiet_NaN(),
                                 std::numeric_limits<float>::infinity(),
                                 -std::numeric_limits<float>::infinity(), 3e38F, -3e38F};
    const std::uint32_t bad = how / 8 % kBad.size();
    mesh.positions[bytes.below(vertices)][bytes.next() % 3] = kBad[bad];
    // Two large ones are needed for an extent that is none.
    if (bad >= 3) mesh.positions[0] = {-kBad[bad], kBad[bad], -kBad[bad]};
    if (bad >= 3) mesh.positions[vertices - 1] = {kBad[bad], -kBad[bad], kBad[bad]};
    made.is_finite = vertices == 1 && bad >= 3;
  } else if (how % 8 == 4) {  // far away and tiny
    for (mesh::Vec3& position : mesh.positions) {
      for (float& coordinate : position) coordinate = 1e4F + coordinate * 1e-4F;
    }
  } else if (how % 8 == 5) {  // layers that are none
    mesh.layer_vertices = {0, vertices / 2, vertices};
    mesh.layer_triangles = {0, triangles / 3, triangles};
    made.has_wrong_layers = true;
  }
}

}  // namespace

MadeUpMesh mesh_from_bytes(std::span<const std::byte> input) {
  Bytes bytes(input);
  MadeUpMesh made;
  made.draco.position_bits = static_cast<int>(8 + bytes.next() % 10);
  made.draco.speed = static_cast<int>(bytes.next() % 16);
  if (made.draco.speed > 10) made.draco.speed = 7;
  const std::uint32_t kind = bytes.next() % 8;
  if (kind < 3) {
    made.mesh = noise_surface(bytes);
    made.is_manifold = true;
  } else if (kind == 3) {
    made.mesh = mesh_of(sheet(bytes, false));
    made.is_manifold = true;
  } else if (kind == 4) {
    made.mesh = mesh_of(sheet(bytes, true));
  } else if (kind == 5) {
    made.mesh = mesh_of(pieces(bytes));
    made.is_manifold = true;
  } else if (kind == 6) {
    Parts parts = bytes.next() % 2 != 0 ? sheet(bytes, false) : pieces(bytes);
    made.mesh = mesh_of(pinched(std::move(parts), bytes));
  } else {
    made.mesh = mesh_of(thrown_together(bytes));
  }
  damage(made.mesh, bytes, made);
  return made;
}

std::vector<std::byte> random_bytes(std::uint64_t seed, std::size_t count) {
  std::uint64_t state = 88172645463325252U + seed * 0x9E3779B97F4A7C15U;
  std::vector<std::byte> bytes(count);
  for (std::byte& byte : bytes) {
    state ^= state << 13;
    state ^= state >> 7;
    state ^= state << 17;
    byte = static_cast<std::byte>(state >> 32);
  }
  return bytes;
}

}  // namespace isomesh::test
