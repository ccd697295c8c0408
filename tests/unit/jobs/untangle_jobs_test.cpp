// Jobs that remove the self-intersections of smoothing.
#include <algorithm>
#include <cstdint>
#include <span>
#include <stop_token>
#include <string>
#include <utility>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "server/codec/formats.h"
#include "server/jobs/making/mesh_cost.h"
#include "server/jobs/making/stage_times.h"
#include "server/jobs/queue/pipeline.h"
#include "server/mesh/measure/join_equal.h"
#include "server/mesh/measure/self_intersections.h"
#include "tests/support/errors.h"
#include "tests/unit/jobs/fixture.h"

namespace isomesh::jobs {
namespace {

class UntangleJobs : public test::PipelineFixture {
 protected:
  // A surface that smoothing tangles.
  Volume add_tangled() {
    return add(test::noise_between<float>(-1, 1.5, {12, 11, 10}, 9), SampleType::kFloat32);
  }

  // Asks for a certificate, too.
  static JobParameters parameters_of(const Volume& volume, double iso) {
    JobParameters parameters = PipelineFixture::parameters_of(volume, iso);
    parameters.passes = 20;
    parameters.untangle = true;
    parameters.certify = true;
    parameters.formats = {MeshFormat::kStl};
    return parameters;
  }

  // The pairs in a file that rounds coordinates, as its readers have it.
  std::uint64_t pairs_in(const MeshSummary& mesh, MeshFormat format) {
    const std::string bytes = blob(mesh.files.at(format).sha256);
    codec::DecodedSurface surface =
        codec::decode(std::as_bytes(std::span(bytes)), format, space_of(format, {}), {});
    mesh::join_equal(surface.positions.span(), surface.triangles.span());
    return find_self_intersections(surface.view(), {}).pairs;
  }
};

TEST_F(UntangleJobs, LeaveNoIntersectionsInTheirFiles) {
  const Volume volume = add_tangled();
  for (const Smoothing smoothing : {Smoothing::kLaplacian, Smoothing::kTaubin}) {
    JobParameters parameters = parameters_of(volume, 0);
    parameters.smoothing = smoothing;
    parameters.untangle = false;
    const MeshSummary tangled = run(volume, parameters).mesh;
    EXPECT_FALSE(tangled.untangled);
    const SelfIntersections& before = tangled.quality.self_intersections.value();
    ASSERT_GT(before.pairs, 0U);
    EXPECT_EQ(before.places.size(), std::min<std::uint64_t>(before.pairs, 100));

    parameters.untangle = true;
    const MeshSummary mesh = run(volume, parameters).mesh;
    ASSERT_TRUE(mesh.untangled);
    EXPECT_EQ(mesh.untangled->pairs, before.pairs);
    EXPECT_EQ(mesh.untangled->left, 0U);
    EXPECT_GT(mesh.untangled->vertices, 0U);
    EXPECT_LT(mesh.untangled->vertices, mesh.vertices);
    EXPECT_EQ(mesh.quality.self_intersections, SelfIntersections{});
    EXPECT_EQ(mesh.triangles, tangled.triangles);
    EXPECT_LT(mesh.displacement_mm.mean, tangled.displacement_mm.mean);
    EXPECT_LE(mesh.displacement_mm.max, tangled.displacement_mm.max);
    EXPECT_NE(mesh.area_mm2, tangled.area_mm2);
    EXPECT_NE(mesh.volume_mm3.smoothed, tangled.volume_mm3.smoothed);
  }
}

TEST_F(UntangleJobs, LeaveNoneInFilesThatRound) {
  const Volume volume = add_tangled();
  for (const MeshFormat format : {MeshFormat::kDrc, MeshFormat::kGlb}) {
    JobParameters parameters = parameters_of(volume, 0);
    parameters.formats = {MeshFormat::kStl, format};
    parameters.untangle = false;
    const MeshSummary tangled = run(volume, parameters).mesh;
    EXPECT_EQ(tangled.quality.self_intersections->pairs, pairs_in(tangled, format));
    parameters.untangle = true;
    const MeshSummary mesh = run(volume, parameters).mesh;
    EXPECT_EQ(mesh.untangled->left, mesh.quality.self_intersections->pairs);
    EXPECT_EQ(mesh.quality.self_intersections->pairs, pairs_in(mesh, format));
    EXPECT_LT(mesh.quality.self_intersections->pairs, tangled.quality.self_intersections->pairs);
  }
}

TEST_F(UntangleJobs, ChangeNothingThatDoesNotIntersect) {
  const Volume volume = add_sphere();
  JobParameters parameters = parameters_of(volume, 0);
  const MeshSummary mesh = run(volume, parameters).mesh;
  EXPECT_EQ(mesh.untangled, Untangling{});
  parameters.untangle = false;
  const MeshSummary plain = run(volume, parameters).mesh;
  EXPECT_EQ(mesh.files.at(MeshFormat::kStl).sha256, plain.files.at(MeshFormat::kStl).sha256);
  EXPECT_EQ(mesh.displacement_mm, plain.displacement_mm);
  EXPECT_EQ(mesh.area_mm2, plain.area_mm2);
}

TEST_F(UntangleJobs, MayHaveNoSurface) {
  const Volume volume = add_sphere();
  const MeshSummary mesh = run(volume, parameters_of(volume, 1e6)).mesh;
  EXPECT_TRUE(mesh.empty);
  EXPECT_EQ(mesh.untangled, Untangling{});
}

TEST_F(UntangleJobs, KeepTheirWordWithinAnError) {
  const Volume volume = add_tangled();
  JobParameters parameters = parameters_of(volume, 0);
  parameters.max_error_mm = 0.2;
  const MeshSummary bound = run(volume, parameters).mesh;
  EXPECT_EQ(bound.quality.self_intersections->pairs, 0U);
  EXPECT_LE(bound.displacement_mm.max, 0.1);
}

TEST_F(UntangleJobs, AreForLabelsToo) {
  const Volume volume =
      add(test::noise<std::uint8_t>({0, 0, 0, 1, 2}, {8, 7, 7}, 3), SampleType::kUint8);
  for (const Smoothing smoothing : {Smoothing::kLaplacian, Smoothing::kLabels}) {
    JobParameters parameters = label_parameters({.values = {1, 2}});
    parameters.volume = volume.id;
    parameters.smoothing = smoothing;
    parameters.lambda = 1;
    parameters.passes = 20;
    parameters.formats = {MeshFormat::kGlb};
    parameters.certify = true;
    const std::uint64_t before = run(volume, parameters).mesh.quality.self_intersections->pairs;
    EXPECT_GT(before, 0U) << to_string(smoothing);
    parameters.untangle = true;
    const MeshSummary mesh = run(volume, parameters).mesh;
    EXPECT_EQ(mesh.untangled->pairs, before);
    EXPECT_EQ(mesh.untangled->left, 0U);
    EXPECT_EQ(mesh.quality.self_intersections->pairs, 0U);
  }
}

TEST_F(UntangleJobs, TellTheStageAndCanBeCancelledInIt) {
  const Volume volume = add_tangled();
  JobParameters parameters = parameters_of(volume, 0);
  parameters.certify = false;
  std::vector<Stage> stages;
  const Report note = [&](Stage stage, double, const Timing&) {
    if (stages.empty() || stages.back() != stage) stages.push_back(stage);
  };
  const PipelineResult result = run(volume, parameters, note);
  EXPECT_THAT(stages, testing::ElementsAre(Stage::kLoad, Stage::kExtract, Stage::kSmooth,
                                           Stage::kUntangle, Stage::kEncode));
  EXPECT_GT(result.timing.untangle, 0);
  EXPECT_FALSE(result.mesh.certificate);
  std::stop_source stop;
  const Report stop_there = [&](Stage stage, double, const Timing&) {
    if (stage == Stage::kUntangle) stop.request_stop();
  };
  EXPECT_EQ(test::code_thrown_by([&] { run(volume, parameters, stop_there, stop.get_token()); }),
            ErrorCode::kCancelled);
}

TEST(UntangleCost, IsOfTheExtractedPositionsAndOneGrid) {
  const mesh::SurfaceSize surface = {2'000'000, 1'000'000};
  MeshParameters parameters;
  const std::uint64_t without = estimate_memory(surface, 0, parameters, {});
  parameters.untangle = true;
  const std::uint64_t with = estimate_memory(surface, 0, parameters, {});
  EXPECT_GE(with, without + surface.triangles * 100 + surface.vertices * sizeof(mesh::Vec3));
  EXPECT_LE(with, without + surface.triangles * 155);
  EXPECT_LE(with, estimate_memory(surface, 0, parameters, {.certify = true}));
  const Timing times = stage_times(surface, surface, {}, parameters, {});
  EXPECT_GT(times.untangle, 1000);
}

}  // namespace
}  // namespace isomesh::jobs
