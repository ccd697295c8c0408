// The numbers that the project is judged by, through the real command.
#include <string>

#include <gtest/gtest.h>

#include "proto/json.h"
#include "tests/api/daemon.h"
#include "tests/support/draco_decoder.h"
#include "tests/support/nifti.h"

namespace isomesh {
namespace {

using namespace test;

struct Golden {
  const char* scheme;
  const char* regularize;
  std::uint64_t triangles;
  std::uint64_t vertices;
  double volume_mm3;
  double area_mm2;
};

class Brain : public testing::TestWithParam<Golden> {};

TEST_P(Brain, HasTheKnownCountsInTheFileToo) {
  const Golden& golden = GetParam();
  const Daemon daemon;
  const TemporaryFolder folder;
  const Finished result =
      daemon.command({"mesh", kBrainFile, "--iso", "60", "--scheme", golden.scheme,
                      golden.regularize, "--passes", "0", "--json", "-o", folder / "brain.drc"});
  ASSERT_EQ(result.status, 0) << result.errors;
  const MeshSummary mesh = job_from_json(result.output).mesh.value();
  EXPECT_EQ(mesh.triangles, golden.triangles);
  EXPECT_EQ(mesh.vertices, golden.vertices);
  EXPECT_NEAR(mesh.volume_mm3.extracted, golden.volume_mm3, 0.5);
  EXPECT_EQ(mesh.volume_mm3.smoothed, mesh.volume_mm3.extracted);
  EXPECT_NEAR(mesh.area_mm2, golden.area_mm2, 0.5);
  const DecodedMesh decoded = decode_with_command(read_file(folder / "brain.drc"));
  EXPECT_EQ(decoded.triangles.size(), golden.triangles);
  EXPECT_EQ(decoded.points.size(), golden.vertices);
}

INSTANTIATE_TEST_SUITE_P(
    Schemes, Brain,
    testing::Values(Golden{"5", "--no-regularize", 4062210, 2033703, 2833341.3, 581722.6},
                    Golden{"6", "--regularize", 1627070, 814234, 2831667.5, 576151.5}),
    [](const auto& golden) {
      const bool is_plain = golden.param.regularize[2] == 'n';
      return std::string("Scheme") + golden.param.scheme + (is_plain ? "" : "Regularised");
    });

}  // namespace
}  // namespace isomesh
