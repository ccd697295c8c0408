#include "server/jobs/queue/pipeline.h"

#include <algorithm>
#include <cmath>
#include <memory>
#include <mutex>
#include <numbers>
#include <numeric>
#include <set>
#include <span>
#include <stop_token>
#include <string>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "server/codec/encode.h"
#include "tests/support/errors.h"
#include "tests/support/step.h"
#include "tests/unit/jobs/fixture.h"

namespace isomesh::jobs {
namespace {

class PipelineTest : public test::PipelineFixture {
 protected:
  // The bytes of the one format that was asked for.
  std::string mesh_bytes(const PipelineResult& result) {
    return blob(result.mesh.files.begin()->second.sha256);
  }
};

TEST_F(PipelineTest, MakesAMeshOfASphere) {
  const Volume volume = add_sphere();
  const PipelineResult result = run(volume, parameters_of(volume, 0));
  const MeshSummary& mesh = result.mesh;
  EXPECT_GT(mesh.triangles, 1000U);
  EXPECT_EQ(mesh.triangles, 2 * mesh.vertices - 4);
  EXPECT_EQ(mesh.boundary_edges, 0U);
  EXPECT_EQ(mesh.components, 1U);
  EXPECT_EQ(mesh.euler, 2);
  const double exact = 4.0 / 3 * std::numbers::pi * std::pow(8.6, 3);
  EXPECT_NEAR(mesh.volume_mm3.extracted, exact, 0.03 * exact);
  EXPECT_LT(mesh.volume_mm3.smoothed, mesh.volume_mm3.extracted);
  EXPECT_GT(mesh.volume_mm3.smoothed, 0.8 * exact);
  EXPECT_GT(mesh.area_mm2, 0.8 * 4 * std::numbers::pi * 8.6 * 8.6);
  EXPECT_NEAR(mesh.bounds[0][0], 12.2 - 8.6, 0.6);
  EXPECT_NEAR(mesh.bounds[1][2], 11.1 + 8.6, 0.6);
  const MeshFile& file = mesh.files.at(MeshFormat::kDrc);
  EXPECT_EQ(blob(file.sha256).size(), file.bytes);
  EXPECT_TRUE(file.href.empty());
}

TEST_F(PipelineTest, JoinsVerticesAndKeepsTheTopology) {
  const Volume volume =
      add(test::noise<std::uint8_t>({0, 0, 1, 2}, {21, 19, 20}, 9), SampleType::kUint8);
  for (const bool close : {false, true}) {
    JobParameters parameters = parameters_of(volume, 0.75);
    parameters.close = close;
    parameters.regularize = false;
    const MeshSummary plain = run(volume, parameters).mesh;
    parameters.regularize = true;
    const MeshSummary joined = run(volume, parameters).mesh;
    EXPECT_LT(joined.triangles, plain.triangles);
    EXPECT_EQ(joined.components, plain.components);
    EXPECT_EQ(joined.euler, plain.euler);
    EXPECT_EQ(joined.boundary_edges, plain.boundary_edges);
    EXPECT_TRUE(joined.quality.manifold);
    EXPECT_TRUE(joined.quality.oriented);
  }
}

TEST_F(PipelineTest, NoPassesLeaveTheVolumeAsExtracted) {
  const Volume volume = add_sphere();
  JobParameters parameters = parameters_of(volume, 0);
  parameters.passes = 0;
  const PipelineResult result = run(volume, parameters);
  EXPECT_EQ(result.mesh.volume_mm3.extracted, result.mesh.volume_mm3.smoothed);
  EXPECT_EQ(result.mesh.area_extracted_mm2, result.mesh.area_mm2);
  EXPECT_EQ(result.mesh.displacement_mm.max, 0);
}

TEST_F(PipelineTest, SaysHowSmoothingChangedTheSurface) {
  const Volume volume = add_sphere();
  JobParameters parameters = parameters_of(volume, 0);
  const MeshSummary laplacian = run(volume, parameters).mesh;
  EXPECT_LT(laplacian.area_mm2, laplacian.area_extracted_mm2);
  EXPECT_GT(laplacian.displacement_mm.mean, 0);
  EXPECT_GT(laplacian.displacement_mm.max, laplacian.displacement_mm.mean);

  parameters.smoothing = Smoothing::kTaubin;
  const MeshSummary taubin = run(volume, parameters).mesh;
  EXPECT_EQ(taubin.volume_mm3.extracted, laplacian.volume_mm3.extracted);
  EXPECT_GT(taubin.volume_mm3.smoothed, 0.998 * taubin.volume_mm3.extracted);
  EXPECT_LT(laplacian.volume_mm3.smoothed, 0.98 * laplacian.volume_mm3.extracted);

  parameters.max_displacement_mm = taubin.displacement_mm.max / 2;
  const MeshSummary held = run(volume, parameters).mesh;
  EXPECT_LE(held.displacement_mm.max, *parameters.max_displacement_mm);
  EXPECT_GT(held.displacement_mm.max, 0.9 * *parameters.max_displacement_mm);
}

TEST_F(PipelineTest, AnIsoOutsideTheRangeIsAnEmptyMesh) {
  const Volume volume = add_sphere();
  JobParameters parameters = parameters_of(volume, 1e6);
  parameters.formats = {MeshFormat::kDrc, MeshFormat::kStl};
  const PipelineResult result = run(volume, parameters);
  EXPECT_EQ(result.mesh.triangles, 0U);
  EXPECT_EQ(result.mesh.vertices, 0U);
  EXPECT_EQ(result.mesh.components, 0U);
  EXPECT_EQ(result.mesh.area_mm2, 0);
  EXPECT_EQ(result.mesh.volume_mm3.extracted, 0);
  EXPECT_EQ(result.mesh.files.size(), 2U);
}

template <class T>
struct Typed {
  SampleType type;
};

TEST_F(PipelineTest, TakesEverySampleType) {
  const test::Field field = test::scaled(test::sphere({6, 6, 6}, 4.2), 5, 50);
  const auto counts = [&]<class T>(Typed<T> sample) {
    const Volume volume = add(test::sample<T>(field, {13, 13, 13}), sample.type);
    const MeshSummary mesh = run(volume, parameters_of(volume, 50)).mesh;
    EXPECT_EQ(mesh.euler, 2) << to_string(sample.type);
    return mesh.triangles;
  };
  std::set<std::uint64_t> seen = {counts(Typed<std::uint8_t>{SampleType::kUint8}),
                                  counts(Typed<std::int8_t>{SampleType::kInt8}),
                                  counts(Typed<std::uint16_t>{SampleType::kUint16}),
                                  counts(Typed<std::int16_t>{SampleType::kInt16}),
                                  counts(Typed<std::uint32_t>{SampleType::kUint32}),
                                  counts(Typed<std::int32_t>{SampleType::kInt32})};
  EXPECT_EQ(seen.size(), 1U);
  seen = {counts(Typed<float>{SampleType::kFloat32}), counts(Typed<double>{SampleType::kFloat64})};
  EXPECT_EQ(seen.size(), 1U);
}

TEST_F(PipelineTest, EveryWayGivesTheSameBytesOnAnyNumberOfThreads) {
  const Volume volume =
      add(test::noise<std::uint8_t>({0, 1, 2}, {19, 17, 40}, 9), SampleType::kUint8);
  for (unsigned way = 0; way < 8; way += test::kStep) {
    JobParameters parameters = parameters_of(volume, 1);
    parameters.scheme = way % 2 == 0 ? SchemeName::kFive : SchemeName::kSix;
    parameters.interpolation = way / 2 % 2 == 0 ? Interpolation::kLinear : Interpolation::kMidpoint;
    parameters.regularize = way / 4 == 0;
    std::set<std::string> results;
    for (const int threads : {1, 2, 3, 8}) {
      JobProcess process(job_program(ISOMESH_JOB, threads));
      results.insert(mesh_bytes(run_pipeline(volume, parameters, {}, blobs_, process, {}, kQuiet)));
    }
    EXPECT_EQ(results.size(), 1U) << way;
  }
}

TEST_F(PipelineTest, AProcessKeepsNothingOfTheJobBefore) {
  const Volume volume = add_sphere();
  const Volume other = add(test::noise<std::uint8_t>({0, 1}, {9, 9, 9}, 2), SampleType::kUint8);
  const std::string expected = mesh_bytes(run(volume, parameters_of(volume, 0)));
  JobProcess process(job_program());
  run_pipeline(other, parameters_of(other, 1), {}, blobs_, process, {}, kQuiet);
  const auto result =
      run_pipeline(volume, parameters_of(volume, 0), {}, blobs_, process, {}, kQuiet);
  EXPECT_EQ(mesh_bytes(result), expected);
}

TEST_F(PipelineTest, ReportsItsStagesInOrderAndItsProgressUpToTheEnd) {
  std::mutex mutex;
  std::vector<Stage> stages;
  double most = 0;
  const Report report = [&](Stage stage, double progress, const Timing&) {
    const std::lock_guard lock(mutex);
    if (stages.empty() || stages.back() != stage) stages.push_back(stage);
    EXPECT_GE(progress, 0);
    EXPECT_LE(progress, 1 + 1e-9);
    most = std::max(most, progress);
  };
  const Volume volume = add_sphere();
  run(volume, parameters_of(volume, 0), report);
  EXPECT_EQ(stages, (std::vector{Stage::kLoad, Stage::kExtract, Stage::kSmooth, Stage::kEncode}));
  EXPECT_NEAR(most, 1, 1e-9);
}

class Cancelled : public PipelineTest, public testing::WithParamInterface<Stage> {};

TEST_P(Cancelled, ThrowsAndStoresNothing) {
  const Volume volume = add_sphere();
  const std::size_t before = blob_count();
  std::stop_source stop;
  const Report stop_there = [&](Stage stage, double, const Timing&) {
    if (stage == GetParam()) stop.request_stop();
  };
  JobParameters parameters = parameters_of(volume, 0);
  parameters.formats = {MeshFormat::kStl, MeshFormat::kDrc};
  EXPECT_EQ(test::code_thrown_by([&] { run(volume, parameters, stop_there, stop.get_token()); }),
            ErrorCode::kCancelled);
  EXPECT_EQ(blob_count(), before);
  EXPECT_EQ(scratch_count(), 0U);
}

INSTANTIATE_TEST_SUITE_P(Stages, Cancelled,
                         testing::Values(Stage::kLoad, Stage::kExtract, Stage::kSmooth,
                                         Stage::kEncode),
                         [](const auto& stage) { return std::string(to_string(stage.param)); });

// Remote blobs, which are sent when they are committed: the stop comes meanwhile.
class StoppedBlobs : public store::FileBlobStore {
 public:
  StoppedBlobs(const store::DataFolder& data, std::stop_source& stop)
      : FileBlobStore(data), stop_(stop) {}

  std::unique_ptr<store::BlobWriter> begin(const std::string& owner) override {
    return std::make_unique<Writer>(FileBlobStore::begin(owner), stop_);
  }

 private:
  class Writer : public store::BlobWriter {
   public:
    Writer(std::unique_ptr<store::BlobWriter> draft, std::stop_source& stop)
        : draft_(std::move(draft)), stop_(stop) {}

    void write(std::span<const std::byte> bytes) override { draft_->write(bytes); }
    store::Blob store(const std::stop_token& stop) override {
      stop_.request_stop();
      if (stop.stop_requested()) throw Error(ErrorCode::kCancelled, "cancelled");
      return draft_->commit(stop);
    }

   private:
    const std::unique_ptr<store::BlobWriter> draft_;
    std::stop_source& stop_;
  };

  std::stop_source& stop_;
};

TEST_F(PipelineTest, StoringItsFilesCanBeStopped) {
  const Volume volume = add_sphere();
  const std::size_t before = blob_count();
  std::stop_source stop;
  StoppedBlobs blobs(data_, stop);
  EXPECT_EQ(test::code_thrown_by([&] {
              run_pipeline(volume, parameters_of(volume, 0), {}, blobs, process_, stop.get_token(),
                           kQuiet);
            }),
            ErrorCode::kCancelled);
  EXPECT_EQ(blob_count(), before);
}

// The first of two formats is stored when the second is begun.
TEST_F(PipelineTest, CancelledBetweenTwoFormatsItStoresNothing) {
  const Volume volume = add_sphere();
  const std::size_t before = blob_count();
  std::stop_source stop;
  const Report stop_half_way = [&](Stage stage, double, const Timing&) {
    if (stage == Stage::kEncode && blob_count() > before) stop.request_stop();
  };
  JobParameters parameters = parameters_of(volume, 0);
  parameters.formats = {MeshFormat::kStl, MeshFormat::kDrc};
  const auto code =
      test::code_thrown_by([&] { run(volume, parameters, stop_half_way, stop.get_token()); });
  if (code) {
    EXPECT_EQ(*code, ErrorCode::kCancelled);
    EXPECT_EQ(blob_count(), before);
  } else {
    EXPECT_EQ(blob_count(), before + 2);
  }
}

TEST_F(PipelineTest, WritesEveryFormatFromOneMesh) {
  const Volume volume = add_sphere();
  JobParameters parameters = parameters_of(volume, 0);
  parameters.formats = {MeshFormat::kDrc, MeshFormat::kGlb, MeshFormat::kStl, MeshFormat::kPly,
                        MeshFormat::kObj};
  parameters.normals = true;
  const PipelineResult result = run(volume, parameters);
  ASSERT_EQ(result.mesh.files.size(), 5U);
  const std::string ply = blob(result.mesh.files.at(MeshFormat::kPly).sha256);
  EXPECT_NE(ply.find("element face " + std::to_string(result.mesh.triangles) + '\n'),
            std::string::npos);
  const std::string obj = blob(result.mesh.files.at(MeshFormat::kObj).sha256);
  EXPECT_EQ(static_cast<std::uint64_t>(std::ranges::count(obj, '\n')),
            1 + result.mesh.vertices + result.mesh.triangles);
  EXPECT_NE(blob(result.mesh.files.at(MeshFormat::kGlb).sha256).find("\"NORMAL\""),
            std::string::npos);
}

TEST_F(PipelineTest, SaysHowGoodAMeshIs) {
  const Volume volume = add_sphere();
  const PipelineResult result = run(volume, parameters_of(volume, 0));
  const MeshQuality& quality = result.mesh.quality;
  EXPECT_TRUE(quality.closed && quality.manifold && quality.oriented);
  EXPECT_EQ(quality.components, 1U);
  EXPECT_EQ(quality.genus, 0);
  const auto sum = [](const Distribution& distribution) {
    return std::accumulate(distribution.histogram.begin(), distribution.histogram.end(),
                           std::uint64_t{0});
  };
  for (const auto& [extracted, smoothed] : {quality.aspect_ratio, quality.smallest_angle_deg}) {
    EXPECT_EQ(sum(extracted), result.mesh.triangles);
    EXPECT_EQ(sum(smoothed), result.mesh.triangles);
    EXPECT_GT(smoothed.mean, extracted.mean) << "smoothing is there for better triangles";
  }
}

// All inside: a box of as many cells as there are between the samples.
TEST_F(PipelineTest, ClosesASurfaceAtTheBorder) {
  const Volume volume = add(test::constant<std::uint8_t>(7, {5, 4, 3}), SampleType::kUint8);
  JobParameters parameters = parameters_of(volume, 7);
  EXPECT_EQ(run(volume, parameters).mesh.triangles, 0U);
  parameters.close = true;
  const MeshSummary mesh = run(volume, parameters).mesh;
  EXPECT_TRUE(mesh.quality.closed);
  EXPECT_EQ(mesh.quality.genus, 0);
  EXPECT_EQ(mesh.boundary_edges, 0U);
  EXPECT_NEAR(mesh.volume_mm3.extracted, 4 * 3 * 2, 1e-5);
  EXPECT_NEAR(mesh.volume_mm3.smoothed, 4 * 3 * 2, 1e-5);
}

TEST_F(PipelineTest, LeavesSmallPartsOutAndSaysSo) {
  const test::Field large = test::sphere({8, 8, 8}, 5);
  const test::Field small = test::sphere({17, 8, 8}, 2);
  const Volume volume =
      add(test::sample<float>([&](const test::Point& p) { return std::max(large(p), small(p)); },
                              {22, 17, 17}),
          SampleType::kFloat32);
  JobParameters parameters = parameters_of(volume, 0);
  const MeshSummary all = run(volume, parameters).mesh;
  ASSERT_EQ(all.components, 2U);
  EXPECT_EQ(all.dropped.components, 0U);
  parameters.components.keep = 1;
  const MeshSummary one = run(volume, parameters).mesh;
  EXPECT_EQ(one.components, 1U);
  EXPECT_EQ(one.quality.components, 1U);
  EXPECT_EQ(one.dropped.components, 1U);
  EXPECT_EQ(one.dropped.triangles, all.triangles - one.triangles);
  EXPECT_LT(one.bounds[1][0], 14);
  EXPECT_LT(one.volume_mm3.extracted, all.volume_mm3.extracted);
}

TEST_F(PipelineTest, AVolumeWhoseSamplesAreGoneIsUnusable) {
  const Volume volume = add_sphere();
  blobs_.erase(volume.samples);
  EXPECT_EQ(test::code_thrown_by([&] { run(volume, parameters_of(volume, 0)); }),
            ErrorCode::kUnusableVolume);
}

TEST_F(PipelineTest, AVolumeWhoseSamplesAreCutBeforeTheyAreReadIsUnusable) {
  const Volume volume = add_sphere();
  test::CutBlobs cut(data_);
  EXPECT_EQ(test::code_thrown_by([&] {
              run_pipeline(volume, parameters_of(volume, 0), {}, cut, process_, {}, kQuiet);
            }),
            ErrorCode::kUnusableVolume);
}

TEST_F(PipelineTest, RefusesAJobThatWouldTakeTooMuchMemory) {
  const Volume volume = add_much();
  const Error error = test::error_of([&] {
    run_pipeline(volume, parameters_of(volume, 50), {.memory_bytes = 1 << 20}, blobs_, process_, {},
                 kQuiet);
  });
  EXPECT_EQ(error.code(), ErrorCode::kTooLarge);
  EXPECT_THAT(error.what(), testing::HasSubstr("1 MiB are allowed"));
}

TEST(Workspace, GivesBackWhatIsBeyondItsBudget) {
  Workspace workspace;
  workspace.mesh.positions.resize_for_overwrite(1000);
  workspace.trim(1 << 20);
  EXPECT_GT(workspace.mesh.positions.capacity_bytes(), 0U);
  workspace.trim(1000);
  EXPECT_EQ(workspace.mesh.positions.capacity_bytes(), 0U);
}

}  // namespace
}  // namespace isomesh::jobs
