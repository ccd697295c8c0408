// Jobs for very few triangles: what is asked is met, or the job says that the surface needs more.
#include <algorithm>
#include <string>
#include <vector>

#include <gtest/gtest.h>

#include "server/codec/formats.h"
#include "server/jobs/queue/pipeline.h"
#include "tests/support/step.h"
#include "tests/unit/jobs/fixture.h"

namespace isomesh::jobs {
namespace {

const std::vector<std::uint32_t> kTargets = {4, 5, 6, 7, 8, 9, 10, 11, 13, 16, 20, 33, 50, 77, 100};

class SmallTargetsTest : public test::PipelineFixture {
 protected:
  using Corner = std::array<std::uint32_t, 3>;

  static void fill(test::SampleVolume<std::uint8_t>& samples, std::uint8_t value,
                   const Corner& from, const Corner& to) {
    for (std::uint32_t k = from[2]; k < to[2]; ++k) {
      for (std::uint32_t j = from[1]; j < to[1]; ++j) {
        for (std::uint32_t i = from[0]; i < to[0]; ++i) samples.at(i, j, k) = value;
      }
    }
  }

  Volume add_cubes(const mesh::Dims& dims, const Corner& from) {
    auto samples = test::constant<std::uint8_t>(0, dims);
    fill(samples, 1, from, {from[0] + 3, from[1] + 3, from[2] + 3});
    fill(samples, 1, {5, 5, 5}, {9, 9, 9});
    return add(samples, SampleType::kUint8);
  }

  // Whatever was certified, no file leaves that its own decoder refuses.
  std::size_t triangles_in(const std::string& file, MeshFormat format) {
    return codec::decode(std::as_bytes(std::span(file)), format, space_of(format, {}), {})
        .triangles.size();
  }

  static void expect_met_or_told(const MeshSummary& mesh, std::uint32_t asked) {
    ASSERT_TRUE(mesh.simplified);
    const bool is_met = mesh.triangles <= asked;
    EXPECT_EQ(mesh.simplified->bound_by,
              is_met ? Simplification::Bound::kTriangles : Simplification::Bound::kTopology)
        << mesh.triangles;
    EXPECT_TRUE(mesh.quality.manifold && mesh.quality.oriented);
  }

  void expect_whole_files(const MeshSummary& mesh) {
    for (const MeshFormat format : {MeshFormat::kDrc, MeshFormat::kGlb}) {
      EXPECT_EQ(triangles_in(blob(mesh.files.at(format).sha256), format), mesh.triangles);
    }
  }
};

TEST_F(SmallTargetsTest, OfTwoCubesAreMetDownToTwoTetrahedra) {
  for (const mesh::Dims& dims : {mesh::Dims{12, 12, 12}, mesh::Dims{10, 14, 17}}) {
    const Volume volume = add_cubes(dims, {1, 1, 1});
    JobParameters parameters = parameters_of(volume, 0.5);
    parameters.formats.clear();
    for (const FormatRow& row : kFormatRows) {
      if (row.format != MeshFormat::kZip) parameters.formats.push_back(row.format);
    }
    for (std::size_t n = 0; n < kTargets.size(); n += test::kStep) {
      const std::uint32_t asked = kTargets[n];
      SCOPED_TRACE(asked);
      parameters.triangles = asked;
      parameters.certify = asked % 2 == 0;
      const MeshSummary mesh = run(volume, parameters).mesh;
      expect_met_or_told(mesh, asked);
      EXPECT_LE(mesh.triangles, std::max(asked, 8U));
      EXPECT_EQ(mesh.components, 2U);
      EXPECT_EQ(mesh.quality.genus, 0);
      EXPECT_GT(mesh.volume_mm3.smoothed, 0);
      expect_whole_files(mesh);
    }
  }
}

TEST_F(SmallTargetsTest, OfSurfacesAtTheBorderAreMetOrTold) {
  const Volume volume = add_cubes({12, 12, 12}, {0, 0, 0});
  JobParameters parameters = parameters_of(volume, 0.5);
  parameters.formats = {MeshFormat::kDrc, MeshFormat::kGlb, MeshFormat::kStl};
  for (const bool close : {false, true}) {
    parameters.close = close;
    for (std::size_t n = 0; n < kTargets.size(); n += test::kStep) {
      const std::uint32_t asked = kTargets[n];
      SCOPED_TRACE(asked);
      parameters.triangles = asked;
      parameters.certify = asked % 2 != 0;
      const MeshSummary mesh = run(volume, parameters).mesh;
      expect_met_or_told(mesh, asked);
      EXPECT_EQ(mesh.quality.closed, close);
      EXPECT_EQ(mesh.components, 2U);
      expect_whole_files(mesh);
    }
  }
}

TEST_F(SmallTargetsTest, OfLabelsAreMetOrTold) {
  auto samples = test::constant<std::uint8_t>(0, {14, 12, 12});
  fill(samples, 1, {1, 1, 1}, {5, 5, 5});
  fill(samples, 2, {5, 1, 1}, {9, 5, 5});  // beside it
  fill(samples, 3, {8, 8, 8}, {11, 11, 11});
  const Volume volume = add(samples, SampleType::kUint8);
  JobParameters parameters = label_parameters({});
  parameters.volume = volume.id;
  parameters.formats = {MeshFormat::kGlb, MeshFormat::kDrc, MeshFormat::kStl, MeshFormat::k3mf};
  for (const bool close : {false, true}) {
    parameters.close = close;
    for (std::size_t n = 0; n < kTargets.size(); n += test::kStep) {
      const std::uint32_t asked = kTargets[n];
      SCOPED_TRACE(asked);
      parameters.triangles = asked;
      parameters.certify = asked % 2 == 0;
      const MeshSummary mesh = run(volume, parameters).mesh;
      expect_met_or_told(mesh, asked);
      const std::string zip = blob(mesh.files.at(MeshFormat::kZip).sha256);
      std::size_t all = 0;
      for (const LabelSummary& label : mesh.labels) {
        EXPECT_TRUE(label.closed && label.manifold && label.oriented) << label.label;
        EXPECT_GE(label.triangles, 4U) << label.label;
        const LabelFile& file = label.files.at(MeshFormat::kDrc);
        EXPECT_EQ(triangles_in(zip.substr(file.offset, file.bytes), MeshFormat::kDrc),
                  label.triangles);
        all += label.triangles;
      }
      EXPECT_EQ(triangles_in(blob(mesh.files.at(MeshFormat::kGlb).sha256), MeshFormat::kGlb), all);
    }
  }
}

// Not the topology, which would allow fewer.
TEST_F(SmallTargetsTest, NameTheErrorWhereItIsWhatBinds) {
  const Volume volume = add_cubes({12, 12, 12}, {1, 1, 1});
  JobParameters parameters = parameters_of(volume, 0.5);
  parameters.triangles = 5;
  parameters.max_error_mm = 0.01;
  parameters.certify = true;
  const MeshSummary mesh = run(volume, parameters).mesh;
  EXPECT_GT(mesh.triangles, 8U);
  EXPECT_EQ(mesh.simplified->bound_by, Simplification::Bound::kError);
}

}  // namespace
}  // namespace isomesh::jobs
