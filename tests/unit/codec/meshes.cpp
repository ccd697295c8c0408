#include "tests/unit/codec/meshes.h"

#include <algorithm>
#include <span>
#include <utility>

#include "server/codec/formats.h"
#include "tests/support/kernels.h"
#include "tests/support/shapes.h"

namespace isomesh::test {
namespace {

// Vertices that lie half-way between samples are never close to each other.
constexpr mesh::ExtractOptions kApart = {0, Scheme::kSix, Interpolation::kMidpoint};

mesh::Mesh extracted_sphere(const Geometry& geometry) {
  const mesh::Dims dims = {18, 17, 16};
  SampleVolume<float> volume = sample<float>(sphere({8.3, 8.1, 7.7}, 5.9), dims);
  volume.geometry = geometry;
  return extracted(volume, kApart);
}

mesh::Mesh open_noise() {
  return extracted(noise<std::uint8_t>({0, 1, 2, 3}, {17, 15, 13}, 7),
                   {2, Scheme::kFive, Interpolation::kMidpoint});
}

mesh::Mesh two_spheres() {
  const Field one = sphere({6, 6, 6}, 4.2);
  const Field other = sphere({17, 6, 6}, 3.1);
  return extracted(
      sample<float>([&](const Point& p) { return std::max(one(p), other(p)); }, {24, 13, 13}),
      kApart);
}

// A grid of right triangles in the plane of constant `axis`.
mesh::Mesh flat_sheet(std::size_t axis) {
  constexpr std::uint32_t kSide = 9;
  std::vector<mesh::Vec3> positions;
  std::vector<mesh::Triangle> triangles;
  for (std::uint32_t v = 0; v < kSide; ++v) {
    for (std::uint32_t u = 0; u < kSide; ++u) {
      mesh::Vec3 position = {12.5F, 12.5F, 12.5F};
      position[(axis + 1) % 3] = 0.37F * static_cast<float>(u);
      position[(axis + 2) % 3] = -1.13F * static_cast<float>(v);
      positions.push_back(position);
      if (u == 0 || v == 0) continue;
      const std::uint32_t corner = v * kSide + u;
      triangles.push_back({corner - kSide - 1, corner - kSide, corner});
      triangles.push_back({corner - kSide - 1, corner, corner - 1});
    }
  }
  return mesh_of(positions, triangles);
}

}  // namespace

std::vector<NamedMesh> meshes_to_encode() {
  std::vector<NamedMesh> meshes;
  const auto add = [&](const std::string& name, mesh::Mesh mesh) {
    meshes.push_back({name, std::move(mesh)});
  };
  add("triangle", mesh_of({{0, 0, 0}, {3, 0.1F, 0}, {0.2F, 2, 1}}, {{0, 1, 2}}));
  add("two apart", mesh_of({{0, 0, 0}, {1, 0, 0}, {0, 1, 0}, {5, 5, 5}, {5, 6, 5}, {6, 5, 5}},
                           {{0, 1, 2}, {3, 4, 5}}));
  add("closed", extracted_sphere({}));
  add("oblique", extracted_sphere(oblique_geometry()));
  add("left-handed", extracted_sphere(left_handed_geometry()));
  add("far", extracted_sphere(far_geometry()));
  add("two closed", two_spheres());
  add("open", open_noise());
  add("flat in x", flat_sheet(0));
  add("flat in y", flat_sheet(1));
  add("flat in z", flat_sheet(2));
  return meshes;
}

mesh::Mesh large_mesh() {
  return extracted(noise<std::uint8_t>({0, 1}, {24, 24, 24}, 3),
                   {0.5, Scheme::kSix, Interpolation::kMidpoint});
}

mesh::Mesh several_blocks() {
  return extracted(sample<float>(sphere({60, 60, 60}, 55), {121, 121, 121}),
                   {0, Scheme::kSix, Interpolation::kMidpoint});
}

std::string encoded(const mesh::Mesh& mesh, MeshFormat format, const DracoParameters& draco) {
  codec::Provenance provenance;
  provenance.parameters.draco = draco;
  return encoded(mesh, format, provenance);
}

std::string encoded(const mesh::Mesh& mesh, MeshFormat format,
                    const codec::Provenance& provenance) {
  std::string bytes;
  codec::encode(mesh, format, provenance, {}, [&](std::span<const std::byte> piece) {
    bytes.append(reinterpret_cast<const char*>(piece.data()), piece.size());
  });
  return bytes;
}

std::vector<MeshFormat> formats_of_a_surface() {
  std::vector<MeshFormat> formats = values_of<MeshFormat>();
  std::erase(formats, MeshFormat::kZip);
  return formats;
}

std::vector<MeshFormat> exact_formats() {
  std::vector<MeshFormat> formats = formats_of_a_surface();
  std::erase_if(formats, [](MeshFormat format) { return codec::rounds(format, {}); });
  return formats;
}

codec::Provenance provenance_in(Space space) {
  codec::Provenance provenance;
  provenance.parameters.space = space;
  return provenance;
}

}  // namespace isomesh::test
