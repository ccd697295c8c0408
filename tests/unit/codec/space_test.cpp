// Files in RAS: the same surface, half a turn about z away.
#include <algorithm>
#include <cmath>
#include <string>
#include <utility>

#include <gtest/gtest.h>

#include "server/codec/decode/decode.h"
#include "server/codec/encode.h"
#include "tests/unit/codec/decode.h"
#include "tests/unit/codec/foreign.h"
#include "tests/unit/codec/label_files.h"
#include "tests/unit/codec/meshes.h"

namespace isomesh::codec {
namespace {

using mesh::Vec3;
using test::encoded;

Provenance in(Space space) {
  Provenance provenance;
  provenance.parameters.space = space;
  return provenance;
}

mesh::Mesh oblique() { return std::move(test::meshes_to_encode().at(3).mesh); }

class SpaceOfFiles : public testing::TestWithParam<MeshFormat> {};

TEST_P(SpaceOfFiles, IsReadBackToWhereTheSurfaceLies) {
  const mesh::Mesh mesh = oblique();
  for (const Space space : {Space::kLps, Space::kRas}) {
    SCOPED_TRACE(to_string(space));
    const Provenance provenance = in(space);
    const std::string file = encoded(mesh, GetParam(), provenance);
    const DecodedSurface read = decode(std::as_bytes(std::span(file)), GetParam(),
                                       space_of(GetParam(), provenance.parameters), {});
    ASSERT_EQ(read.triangles.size(), mesh.triangles.size());
    Vec3 low = {1e9F, 1e9F, 1e9F};
    Vec3 expected = low;
    for (std::size_t axis = 0; axis < 3; ++axis) {
      for (const Vec3& at : read.positions) low[axis] = std::min(low[axis], at[axis]);
      for (const Vec3& at : mesh.positions) expected[axis] = std::min(expected[axis], at[axis]);
      EXPECT_NEAR(low[axis], expected[axis], 0.01);
    }
  }
}

TEST_P(SpaceOfFiles, IsThatOfTheParameterUnlessTheFormatHasItsOwn) {
  const mesh::Mesh mesh = oblique();
  const std::string lps = encoded(mesh, GetParam(), in(Space::kLps));
  const std::string ras = encoded(mesh, GetParam(), in(Space::kRas));
  // GLB and GIFTI say in their provenance alone which space was asked for.
  const bool has_own = GetParam() == MeshFormat::kGlb || GetParam() == MeshFormat::kGii;
  EXPECT_EQ(space_of(GetParam(), in(Space::kRas).parameters) ==
                space_of(GetParam(), in(Space::kLps).parameters),
            has_own);
  EXPECT_NE(lps, ras);
  if (has_own) return;
  const auto as_lps = decode(std::as_bytes(std::span(ras)), GetParam(), Space::kLps, {});
  const auto right = decode(std::as_bytes(std::span(ras)), GetParam(), Space::kRas, {});
  ASSERT_GT(right.positions.size(), 0U);
  for (std::size_t v = 0; v < right.positions.size(); ++v) {
    const auto& [x, y, z] = right.positions[v];
    ASSERT_EQ(as_lps.positions[v], (Vec3{-x, -y, z}));
  }
}

INSTANTIATE_TEST_SUITE_P(Formats, SpaceOfFiles, testing::ValuesIn(test::formats_of_a_surface()),
                         [](const auto& test) { return std::string(to_string(test.param)); });

TEST(SpaceOfStl, AssimpFindsTurnedNormalsWithTheTriangles) {
  const mesh::Mesh mesh = oblique();
  const std::string ras = encoded(mesh, MeshFormat::kStl, in(Space::kRas));
  EXPECT_NE(ras.find("SPACE=RAS"), std::string::npos);
  const auto read = test::read_with_assimp(ras, "stl");
  ASSERT_EQ(read.size(), mesh.triangles.size());
  for (std::size_t t = 0; t < read.size(); ++t) {
    for (std::size_t corner = 0; corner < 3; ++corner) {
      const auto& [x, y, z] = mesh.positions[mesh.triangles[t][corner]];
      ASSERT_EQ(read[t][corner], (Vec3{-x, -y, z}));
    }
  }
}

class SpaceOfLabels : public test::LabelFilesTest {};

TEST_F(SpaceOfLabels, LabelsInAZipShareOneGridThereToo) {
  provenance_.parameters.space = Space::kRas;
  const Zip zip = zipped({MeshFormat::kDrc});
  std::vector<Places> places;
  for (const LabelFiles& files : zip.files) {
    const LabelFile& file = files.at(MeshFormat::kDrc);
    Places& own = places.emplace_back();
    for (const auto& [x, y, z] :
         test::decode_in_process(zip.bytes.substr(file.offset, file.bytes)).points) {
      own.insert({-x, -y, z});
    }
  }
  expect_shared(places);
  float least = 0;
  for (const Vec3& place : *std::ranges::max_element(places, {}, &Places::size)) {
    least = std::min(least, place[0]);
  }
  EXPECT_GT(least, -1) << "the surface lies where it is positive in LPS";
}

}  // namespace
}  // namespace isomesh::codec
