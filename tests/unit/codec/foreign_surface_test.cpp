// Files for VTK and for neuroimaging, read by VTK and by nibabel: the same vertices and triangles.
#include <algorithm>
#include <map>
#include <string>
#include <utility>
#include <vector>

#include <gtest/gtest.h>

#include "server/codec/encode.h"
#include "tests/unit/codec/foreign.h"
#include "tests/unit/codec/label_files.h"
#include "tests/unit/codec/meshes.h"

namespace isomesh::codec {
namespace {

using test::encoded;
using test::read_with_python;

class PythonReader : public testing::TestWithParam<MeshFormat> {};

// foreign_exact_test.cpp has where they are.
TEST_P(PythonReader, FindsTheVerticesThatTrianglesShare) {
  const mesh::Mesh mesh = test::large_mesh();
  const test::DecodedMesh read = read_with_python(encoded(mesh, GetParam()), GetParam()).mesh;
  EXPECT_EQ(read.points.size(), mesh.positions.size());
  EXPECT_TRUE(std::ranges::equal(read.triangles, mesh.triangles));
}

TEST_P(PythonReader, FindsNothingInAnEmptySurface) {
  const auto read = read_with_python(encoded(mesh::Mesh{}, GetParam()), GetParam());
  EXPECT_TRUE(read.mesh.points.empty());
  EXPECT_TRUE(read.mesh.triangles.empty());
  EXPECT_TRUE(read.labels.empty());
}

INSTANTIATE_TEST_SUITE_P(Formats, PythonReader,
                         testing::Values(MeshFormat::kVtk, MeshFormat::kVtp, MeshFormat::kGii),
                         [](const auto& test) { return std::string(to_string(test.param)); });

Provenance known() {
  Provenance provenance;
  provenance.samples = "abc";
  provenance.iso = 42;
  provenance.notes = {{"orientation", "a < b & c ]]> d"}};
  return provenance;
}

TEST(PythonReaderOfProvenance, VtpSaysItInFieldData) {
  Provenance provenance = known();
  const mesh::Mesh mesh = std::move(test::meshes_to_encode().front().mesh);
  auto told = read_with_python(encoded(mesh, MeshFormat::kVtp, provenance), MeshFormat::kVtp).told;
  EXPECT_EQ(told["SPACE"], "LPS");
  auto json = nlohmann::json::parse(told["isomesh:provenance"].get<std::string>());
  EXPECT_EQ(json["samples"], "abc");
  EXPECT_EQ(json["iso"], 42);
  EXPECT_EQ(json["notes"][0]["detail"], "a < b & c ]]> d");
  provenance.parameters.space = Space::kRas;
  told = read_with_python(encoded(mesh, MeshFormat::kVtp, provenance), MeshFormat::kVtp).told;
  EXPECT_EQ(told["SPACE"], "RAS");
}

TEST(PythonReaderOfProvenance, GiftiSaysItInItsMetadata) {
  const mesh::Mesh mesh = std::move(test::meshes_to_encode().front().mesh);
  const auto told =
      read_with_python(encoded(mesh, MeshFormat::kGii, known()), MeshFormat::kGii).told;
  EXPECT_EQ(told["dataspace"], "NIFTI_XFORM_SCANNER_ANAT");
  EXPECT_EQ(told["AnatomicalStructurePrimary"], "Other");
  const auto json = nlohmann::json::parse(told["isomesh:provenance"].get<std::string>());
  EXPECT_EQ(json["samples"], "abc");
  EXPECT_EQ(json["notes"][0]["detail"], "a < b & c ]]> d");
}

TEST(PythonReaderOfProvenance, VtkSaysItsSpaceInTheTitle) {
  const mesh::Mesh mesh = std::move(test::meshes_to_encode().front().mesh);
  const auto told = read_with_python(encoded(mesh, MeshFormat::kVtk), MeshFormat::kVtk).told;
  EXPECT_EQ(told["title"], "isomesh, millimetres, SPACE=LPS");
}

class PythonReaderOfLabels : public test::LabelFilesTest {};

TEST_F(PythonReaderOfLabels, FindsEachLabelsTriangles) {
  for (const MeshFormat format : {MeshFormat::kVtk, MeshFormat::kVtp}) {
    SCOPED_TRACE(to_string(format));
    const auto read = read_with_python(encoded(format), format);
    EXPECT_EQ(read.mesh.points.size(), walls_.mesh.positions.size());
    ASSERT_EQ(read.labels.size(), read.mesh.triangles.size());
    std::map<std::int64_t, std::uint64_t> triangles;
    for (const std::int64_t label : read.labels) ++triangles[label];
    ASSERT_EQ(triangles.size(), kLabels);
    for (const LabelSummary& label : labels_) {
      EXPECT_EQ(triangles[label.label], label.triangles) << label.label;
    }
  }
}

TEST_F(PythonReaderOfLabels, FindsValuesThatAreNegativeOrLarge) {
  for (const std::int64_t last : {std::int64_t{5}, std::int64_t{4'000'000'000}}) {
    labels_.front().label = last == 5 ? -7 : 1;
    labels_.back().label = last;
    for (const MeshFormat format : {MeshFormat::kVtk, MeshFormat::kVtp}) {
      const auto read = read_with_python(encoded(format), format);
      EXPECT_TRUE(std::ranges::count(read.labels, last) > 0) << to_string(format);
      EXPECT_EQ(static_cast<std::uint64_t>(std::ranges::count(read.labels, labels_.front().label)),
                labels_.front().triangles)
          << to_string(format);
    }
  }
}

}  // namespace
}  // namespace isomesh::codec
