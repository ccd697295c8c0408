// Jobs whose files are written while the surface is walked through.
#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <string>
#include <utility>
#include <vector>

#include <fcntl.h>
#include <gtest/gtest.h>

#include "proto/json.h"
#include "server/jobs/making/mesh_cost.h"
#include "server/jobs/making/spool_file.h"
#include "server/jobs/queue/pipeline.h"
#include "tests/support/errors.h"
#include "tests/support/kernels.h"
#include "tests/unit/jobs/fixture.h"

namespace isomesh::jobs {
namespace {

// All that a record tells of a mesh, but for its files.
std::string without_files(MeshSummary summary) {
  summary.files.clear();
  Job job;
  job.mesh = std::move(summary);
  return to_record(job);
}

class WalkJobs : public test::PipelineFixture {};

// With a format that needs the whole surface, all of the job is made of it.
TEST_F(WalkJobs, WriteAndTellWhatIsMadeOfTheWholeSurface) {
  const Volume volume =
      add(test::noise<std::uint8_t>({0, 1, 2, 9}, {100, 90, 80}, 9), SampleType::kUint8);
  JobParameters parameters = parameters_of(volume, 1);
  parameters.close = true;
  parameters.smoothing = Smoothing::kTaubin;
  parameters.max_displacement_mm = 0.1;
  parameters.space = Space::kRas;
  parameters.glb_codec = GlbCodec::kKhrMeshopt;
  parameters.formats = {MeshFormat::kStl, MeshFormat::kGlb};
  const MeshSummary walked = run(volume, parameters).mesh;
  constexpr std::uint64_t kLayers = 80;
  ASSERT_TRUE(
      is_walked(test::even_surface(kLayers, walked.vertices / kLayers, walked.triangles / kLayers),
                parameters, {}));
  parameters.formats.push_back(MeshFormat::kOff);
  ASSERT_FALSE(can_be_walked(parameters, {}));
  const MeshSummary whole = run(volume, parameters).mesh;
  for (const MeshFormat format : {MeshFormat::kStl, MeshFormat::kGlb}) {
    EXPECT_EQ(walked.files.at(format).sha256, whole.files.at(format).sha256);
  }
  EXPECT_EQ(without_files(walked), without_files(whole));
}

TEST(CanBeWalked, OnlyWithoutWhatNeedsTheWholeSurface) {
  MeshParameters parameters;
  parameters.formats = {MeshFormat::kStl};
  EXPECT_TRUE(can_be_walked(parameters, {}));
  EXPECT_FALSE(can_be_walked(parameters, {.certify = true}));
  EXPECT_FALSE(can_be_walked(parameters, {.min_thickness_mm = 0.4}));
  const auto with = [&](auto change) {
    MeshParameters changed = parameters;
    change(changed);
    return can_be_walked(changed, {});
  };
  EXPECT_FALSE(with([](MeshParameters& p) { p.formats = {MeshFormat::kDrc}; }));
  const auto as_glb = [&](auto change) {
    return with([&](MeshParameters& p) {
      p.formats = {MeshFormat::kGlb};
      change(p);
    });
  };
  EXPECT_TRUE(as_glb([](MeshParameters& /*p*/) {}));
  EXPECT_TRUE(as_glb([](MeshParameters& p) { p.glb_codec = GlbCodec::kNone; }));
  EXPECT_FALSE(as_glb([](MeshParameters& p) { p.merge = true; }));
  EXPECT_FALSE(as_glb([](MeshParameters& p) { p.distances = true; }));
  EXPECT_FALSE(as_glb([](MeshParameters& p) { p.lods = {1, 0.5}; }));
  EXPECT_FALSE(with([](MeshParameters& p) { p.components.keep = 1; }));
  EXPECT_FALSE(with([](MeshParameters& p) { p.fill_cavities = true; }));
  EXPECT_FALSE(with([](MeshParameters& p) { p.untangle = true; }));
  EXPECT_FALSE(with([](MeshParameters& p) { p.triangles = 1000; }));
  EXPECT_FALSE(with([](MeshParameters& p) { p.max_error_mm = 1; }));
  EXPECT_FALSE(with([](MeshParameters& p) { p.smoothing = Smoothing::kOptimize; }));
}

TEST(IsWalked, UnlessTheSurfaceIsSmall) {
  const mesh::SurfaceSize small = test::even_surface(512, 2'000, 4'000);
  const mesh::SurfaceSize large = test::even_surface(512, 15'000, 30'000);
  MeshParameters parameters;
  for (const MeshFormat format : {MeshFormat::kGlb, MeshFormat::kStl}) {
    parameters.formats = {format};
    for (const GlbCodec codec : {GlbCodec::kDraco, GlbCodec::kNone}) {
      parameters.glb_codec = codec;
      EXPECT_FALSE(is_walked(small, parameters, {}));
      EXPECT_TRUE(is_walked(large, parameters, {}));
      EXPECT_FALSE(is_walked(large, parameters, {.certify = true}));
    }
  }
}

// Large slices of a microscope.
TEST(IsWalked, UnlessAFewLargeLayersTakeLessAsAWhole) {
  const mesh::SurfaceSize few = test::even_surface(3, 1'000'000, 2'000'000);
  const mesh::SurfaceSize many = test::even_surface(300, 10'000, 20'000);
  MeshParameters parameters;
  parameters.passes = 20;
  const test::ThreadCount two(2);
  for (const MeshFormat format : {MeshFormat::kGlb, MeshFormat::kStl}) {
    parameters.formats = {format};
    EXPECT_FALSE(is_walked(few, parameters, {}));
    EXPECT_TRUE(is_walked(many, parameters, {}));
  }
}

TEST(EstimateMemory, FollowsTheLayerOfAWalk) {
  MeshParameters parameters;
  parameters.formats = {MeshFormat::kStl, MeshFormat::kGlb};
  const mesh::SurfaceSize surface = test::even_surface(1024, 30'000, 60'000);
  const mesh::SurfaceSize twice = test::even_surface(2048, 30'000, 60'000);
  const std::uint64_t samples = std::uint64_t{1} << 30;
  const std::uint64_t needed = estimate_memory(surface, samples, parameters, {});
  EXPECT_LT(needed, std::uint64_t{700} << 20);
  EXPECT_LT(estimate_memory(twice, 2 * samples, parameters, {}), needed * 21 / 20);
  EXPECT_GT(estimate_memory(surface, samples, parameters, {.certify = true}), 3 * needed);
}

TEST(SpoolFile, GivesBackWhatItTook) {
  const test::TemporaryFolder folder;
  SpoolFile spool(folder.path());
  EXPECT_TRUE(std::filesystem::is_empty(folder.path())) << "it has no name";
  const std::array<std::byte, 3> bytes = {std::byte{1}, std::byte{2}, std::byte{3}};
  spool.write(5'000'000'000, bytes);
  std::array<std::byte, 3> read = {};
  spool.read(5'000'000'000, read);
  EXPECT_EQ(read, bytes);
  spool.clear();
  EXPECT_EQ(test::code_thrown_by([&] { spool.read(5'000'000'000, read); }), ErrorCode::kInternal);
}

TEST(SpoolFile, SaysThatTheDiskIsFull) {
  SpoolFile spool(Descriptor(::open("/dev/full", O_RDWR | O_CLOEXEC)));
  const std::array<std::byte, 3> bytes = {};
  EXPECT_EQ(test::code_thrown_by([&] { spool.write(0, bytes); }), ErrorCode::kOutOfSpace);
}

}  // namespace
}  // namespace isomesh::jobs
