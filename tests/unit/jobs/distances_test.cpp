// Jobs whose GLB holds the vertices' distances.
#include <string>

#include <gtest/gtest.h>

#include "server/jobs/making/mesh_cost.h"
#include "server/jobs/queue/pipeline.h"
#include "tests/unit/jobs/fixture.h"

namespace isomesh::jobs {
namespace {

class DistanceJobs : public test::PipelineFixture {
 protected:
  std::string glb_of(const Volume& volume, const JobParameters& parameters) {
    const MeshSummary mesh = run(volume, parameters).mesh;
    EXPECT_FALSE(mesh.certificate);
    return blob(mesh.files.at(MeshFormat::kGlb).sha256);
  }
};

bool has_distances(const std::string& glb) { return glb.find("_DISTANCE_MM") != std::string::npos; }

TEST_F(DistanceJobs, PutThemIntoGlbWhereTheyAreAskedForAndNotElse) {
  const Volume volume = add_sphere();
  JobParameters parameters = parameters_of(volume, 0);
  parameters.formats = {MeshFormat::kGlb, MeshFormat::kStl};
  EXPECT_FALSE(has_distances(glb_of(volume, parameters)));
  parameters.distances = true;
  EXPECT_TRUE(has_distances(glb_of(volume, parameters)));
  parameters.lods = {1, 0.2};
  parameters.triangles = 500;
  EXPECT_TRUE(has_distances(glb_of(volume, parameters)));
}

TEST_F(DistanceJobs, OfASurfaceWithoutTrianglesAreNone) {
  const Volume volume = add_sphere();
  JobParameters parameters = parameters_of(volume, 1e6);
  parameters.formats = {MeshFormat::kGlb};
  parameters.distances = true;
  EXPECT_FALSE(has_distances(glb_of(volume, parameters)));
}

TEST_F(DistanceJobs, AreForLabelsToo) {
  auto samples = test::constant<std::uint8_t>(0, {12, 12, 12});
  for (std::uint32_t k = 3; k < 9; ++k) {
    for (std::uint32_t j = 3; j < 9; ++j) {
      for (std::uint32_t i = 3; i < 9; ++i) samples.at(i, j, k) = i < 6 ? 1 : 2;
    }
  }
  const Volume volume = add(samples, SampleType::kUint8);
  JobParameters parameters = label_parameters({.values = {1, 2}});
  parameters.volume = volume.id;
  parameters.formats = {MeshFormat::kGlb};
  parameters.distances = true;
  EXPECT_TRUE(has_distances(glb_of(volume, parameters)));
}

TEST(DistanceCost, IsOfTheExtractedSurfaceAndItsGrid) {
  const mesh::SurfaceSize surface = {2'000'000, 1'000'000};
  MeshParameters parameters;
  parameters.formats = {MeshFormat::kGlb};
  const std::uint64_t without = estimate_memory(surface, 0, parameters, {});
  parameters.distances = true;
  const std::uint64_t with = estimate_memory(surface, 0, parameters, {});
  EXPECT_GT(with, without + surface.triangles * 100);
  EXPECT_LE(with, estimate_memory(surface, 0, parameters, {.certify = true}));
  // Thickness needs the grid of the mesh itself.
  parameters = {};
  parameters.components.keep = 1;
  const std::uint64_t plain = estimate_memory(surface, 0, parameters, {});
  const std::uint64_t thickness =
      estimate_memory(surface, 0, parameters, {.min_thickness_mm = 0.4});
  EXPECT_GT(thickness, plain + surface.triangles * 100);
  // And so do cavities, of their walls.
  parameters.fill_cavities = true;
  EXPECT_GT(estimate_memory(surface, 0, parameters, {}), plain + surface.triangles * 40);
}

}  // namespace
}  // namespace isomesh::jobs
