// The formats that round nothing, read by programs that are not ours: the same floats and the same
// triangles, in either space. Certificates rely on it: they measure the mesh, and not these files.
#include <algorithm>
#include <limits>
#include <string>
#include <vector>

#include <gtest/gtest.h>

#include "server/codec/formats.h"
#include "server/mesh/labels/label_surface.h"
#include "tests/unit/codec/foreign.h"
#include "tests/unit/codec/foreign_cgal.h"
#include "tests/unit/codec/label_files.h"
#include "tests/unit/codec/meshes.h"
#include "tests/unit/codec/placed.h"

namespace isomesh::codec {
namespace {

using mesh::Vec3;
using test::encoded;
using test::exact_formats;
using test::PlacedTriangle;
using test::read_exactly;

// The triangles of the mesh where a file in that space has them, in their order.
std::vector<PlacedTriangle> triangles_in(Space space, const mesh::Mesh& mesh) {
  const auto place = [&](std::uint32_t vertex) {
    const auto& [x, y, z] = mesh.positions[vertex];
    return space == Space::kLps ? Vec3{x, y, z} : Vec3{-x, -y, z};
  };
  std::vector<PlacedTriangle> triangles;
  for (const auto& [a, b, c] : mesh.triangles) triangles.push_back({place(a), place(b), place(c)});
  return triangles;
}

class ExactFormat : public testing::TestWithParam<MeshFormat> {
 protected:
  static void expect_exact(const mesh::Mesh& mesh) {
    for (const Space asked : {Space::kLps, Space::kRas}) {
      const Provenance provenance = test::provenance_in(asked);
      const Space space = space_of(GetParam(), provenance.parameters);
      const auto found = read_exactly(encoded(mesh, GetParam(), provenance), GetParam());
      EXPECT_TRUE(found == triangles_in(space, mesh)) << to_string(asked);
    }
  }
};

TEST_P(ExactFormat, HoldsTheSameFloatsAndTriangles) {
  for (const auto& [name, mesh] : test::meshes_to_encode()) {
    const bool is_one_of_few = name == "oblique" || name == "open" || name == "far";
    if (test::is_read_by_python(GetParam()) && !is_one_of_few)
      continue;  // Python takes its time to start
    SCOPED_TRACE(name);
    expect_exact(mesh);
  }
  expect_exact(test::large_mesh());
}

TEST_P(ExactFormat, HoldsNumbersThatAreHardToWrite) {
  using Limits = std::numeric_limits<float>;
  expect_exact(test::mesh_of({{0.1F, 1.0F / 3, -123.456F},
                              {1e-20F, 16777218, 1 + Limits::epsilon()},
                              {-0.0F, 123456.79F, 7e-5F},
                              {8388608.5F, 33554436, 1e-3F}},
                             {{0, 1, 2}, {0, 2, 3}, {0, 3, 1}, {1, 3, 2}}));
}

INSTANTIATE_TEST_SUITE_P(Formats, ExactFormat, testing::ValuesIn(exact_formats()),
                         [](const auto& test) { return std::string(to_string(test.param)); });

TEST(ExactText, NamesTheSameVertices) {
  for (const MeshFormat format : {MeshFormat::kObj, MeshFormat::kOff}) {
    for (const auto& [name, mesh] : test::meshes_to_encode()) {
      SCOPED_TRACE(name);
      const test::DecodedMesh read = test::read_with_cgal(encoded(mesh, format), format);
      EXPECT_TRUE(std::ranges::equal(read.points, mesh.positions));
      EXPECT_TRUE(std::ranges::equal(read.triangles, mesh.triangles));
    }
  }
}

class ExactLabels : public test::LabelFilesTest {
 protected:
  // Makes lists of triangles comparable: the encoder of labels chooses first corners and triangle
  // order.
  static std::vector<PlacedTriangle> ordered(std::vector<PlacedTriangle> triangles) {
    std::ranges::transform(triangles, triangles.begin(), test::turned);
    std::ranges::sort(triangles);
    return triangles;
  }
};

TEST_F(ExactLabels, FilesOfAllLabelsHaveEachLabelsTriangles) {
  const auto expected_in = [&](Space space) {
    std::vector<PlacedTriangle> expected;
    for (std::size_t n = 1; n <= kLabels; ++n) {
      const auto own = triangles_in(space, surface_of(n));
      expected.insert(expected.end(), own.begin(), own.end());
    }
    return ordered(std::move(expected));
  };
  const std::vector<PlacedTriangle> in_lps = expected_in(Space::kLps);
  const std::vector<PlacedTriangle> in_ras = expected_in(Space::kRas);
  for (const Space asked : {Space::kLps, Space::kRas}) {
    provenance_.parameters.space = asked;
    for (const MeshFormat format : exact_formats()) {
      if (!holds_all_labels(format)) continue;
      const bool is_ras = space_of(format, provenance_.parameters) == Space::kRas;
      EXPECT_TRUE(ordered(read_exactly(encoded(format), format)) == (is_ras ? in_ras : in_lps))
          << to_string(format);
    }
  }
}

TEST_F(ExactLabels, FilesInAZipHaveTheirLabelsTriangles) {
  std::vector<MeshFormat> formats = exact_formats();
  // These hold all labels, always.
  std::erase_if(formats, [](MeshFormat format) {
    return format == MeshFormat::k3mf || format == MeshFormat::kUsda || format == MeshFormat::kUsdz;
  });
  const Zip zip = zipped(formats);
  for (const std::size_t n : {std::size_t{1}, kLabels}) {
    for (const MeshFormat format : formats) {
      const LabelFile& file = zip.files[n - 1].at(format);
      const auto found = read_exactly(zip.bytes.substr(file.offset, file.bytes), format);
      EXPECT_TRUE(found == triangles_in(space_of(format, {}), surface_of(n))) << to_string(format);
    }
  }
}

}  // namespace
}  // namespace isomesh::codec
