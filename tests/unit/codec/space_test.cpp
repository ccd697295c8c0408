// Files in RAS: the same surface, half a turn about z away.
#include <algorithm>
#include <cmath>
#include <string>
#include <utility>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "server/codec/decode/decode.h"
#include "server/codec/encode.h"
#include "tests/unit/codec/decode.h"
#include "tests/unit/codec/label_files.h"
#include "tests/unit/codec/meshes.h"

namespace isomesh::codec {
namespace {

using mesh::Vec3;
using test::encoded;
using test::provenance_in;
using testing::HasSubstr;
using testing::Not;

mesh::Mesh oblique() { return std::move(test::meshes_to_encode().at(3).mesh); }

// Formats that round nothing are read in both spaces by foreign_exact_test.cpp.
class SpaceOfFiles : public testing::TestWithParam<MeshFormat> {};

TEST_P(SpaceOfFiles, IsReadBackToWhereTheSurfaceLies) {
  const mesh::Mesh mesh = oblique();
  for (const Space space : {Space::kLps, Space::kRas}) {
    SCOPED_TRACE(to_string(space));
    const Provenance provenance = provenance_in(space);
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

INSTANTIATE_TEST_SUITE_P(Formats, SpaceOfFiles, testing::Values(MeshFormat::kDrc, MeshFormat::kGlb),
                         [](const auto& test) { return std::string(to_string(test.param)); });

TEST(SpaceOf, IsThatOfTheParameterUnlessTheFormatHasItsOwn) {
  for (const MeshFormat format : test::formats_of_a_surface()) {
    const bool has_own = format == MeshFormat::kGlb || format == MeshFormat::kGii ||
                         format == MeshFormat::kUsda || format == MeshFormat::kUsdz;
    EXPECT_EQ(space_of(format, provenance_in(Space::kRas).parameters) ==
                  space_of(format, provenance_in(Space::kLps).parameters),
              has_own)
        << to_string(format);
    // GLB, GIFTI and USD say in their provenance alone which space was asked for.
    EXPECT_NE(encoded(oblique(), format, provenance_in(Space::kLps)),
              encoded(oblique(), format, provenance_in(Space::kRas)))
        << to_string(format);
  }
}

// 3D Slicer takes a file that says neither for LPS, and so turns one in RAS by 180 degrees.
TEST(SpaceOf, IsInTheHeaderInTheWordsThat3dSlicerLooksFor) {
  for (const MeshFormat format :
       {MeshFormat::kStl, MeshFormat::kVtk, MeshFormat::kPly, MeshFormat::kObj, MeshFormat::kOff}) {
    SCOPED_TRACE(to_string(format));
    const std::string lps = encoded(oblique(), format, provenance_in(Space::kLps));
    EXPECT_THAT(lps, HasSubstr("SPACE=LPS"));
    EXPECT_THAT(lps, Not(HasSubstr("SPACE=RAS")));
    const std::string ras = encoded(oblique(), format, provenance_in(Space::kRas));
    EXPECT_THAT(ras, HasSubstr("SPACE=RAS"));
    EXPECT_THAT(ras, Not(HasSubstr("SPACE=LPS")));
  }
}

class SpaceOfLabels : public test::LabelFilesTest {};

TEST_F(SpaceOfLabels, IsInTheHeaderThereToo) {
  for (const MeshFormat format : {MeshFormat::kVtk, MeshFormat::kPly, MeshFormat::kObj}) {
    provenance_.parameters.space = Space::kRas;
    EXPECT_THAT(encoded(format), HasSubstr("SPACE=RAS")) << to_string(format);
    provenance_.parameters.space = Space::kLps;
    EXPECT_THAT(encoded(format), HasSubstr("SPACE=LPS")) << to_string(format);
  }
}

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
