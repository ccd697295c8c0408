#include "server/jobs/queue/estimate.h"

#include <cstdint>
#include <optional>
#include <set>
#include <utility>

#include <gmock/gmock.h>

#include "server/jobs/library/histograms.h"
#include "server/jobs/making/make_mesh.h"
#include "server/jobs/making/mesh_cost.h"
#include "server/jobs/making/stage_times.h"
#include "server/jobs/queue/workers.h"
#include "tests/support/errors.h"
#include "tests/support/stores.h"
#include "tests/unit/jobs/faulty_job.h"
#include "tests/unit/jobs/fixture.h"

namespace isomesh::jobs {
namespace {

class EstimateTest : public test::JobsFixture {
 protected:
  Job run(const JobParameters& parameters) {
    const Workers workers({.threads = 1, .program = job_program()}, jobs_, volumes_, blobs_);
    return test::end_of(jobs_, "", job_of(jobs_.submit({"", parameters, "", ""})).id);
  }

  // The estimate, whose counts are those of the job.
  Estimate exact(const JobParameters& parameters) {
    Estimate estimate = estimator_.estimate("", parameters);
    const Job job = run(parameters);
    EXPECT_TRUE(job.mesh);
    EXPECT_EQ(estimate.triangles, job.mesh->triangles);
    EXPECT_EQ(estimate.vertices, job.mesh->vertices);
    EXPECT_EQ(estimate.labels.size(), job.mesh->labels.size());
    for (std::size_t n = 0; n < estimate.labels.size(); ++n) {
      EXPECT_EQ(estimate.labels[n].triangles, job.mesh->labels.at(n).triangles);
    }
    return estimate;
  }

  Estimator estimator_{volumes_, blobs_, jobs_, {.memory_bytes = 4 << 20}, job_program()};
};

// A job that is rejected too late is tried forever.
TEST(CheckDisk, RejectsFilesThatCanNeverFit) {
  const mesh::SurfaceSize surface = {.triangles = 1'000'000, .vertices = 500'000};
  const Volume volume;
  MeshParameters parameters;
  const auto code_of = [&](MeshFormat format, std::uint64_t disk_bytes) {
    parameters.formats = {format};
    return test::code_thrown_by([&] {
      check_disk(surface, {.volume = volume,
                           .parameters = parameters,
                           .iso = 0,
                           .measures = {},
                           .memory_bytes = 0,
                           .disk_bytes = disk_bytes});
    });
  };
  using Case = std::pair<MeshFormat, std::uint64_t>;
  for (const auto& [format, bytes] :
       {Case(MeshFormat::kStl, 50'000'000), Case(MeshFormat::kPly, 19'000'000),
        Case(MeshFormat::kVtk, 22'000'000)}) {
    EXPECT_EQ(code_of(format, bytes - 1), ErrorCode::kTooLarge) << to_string(format);
    EXPECT_EQ(code_of(format, bytes + 4000), std::nullopt) << to_string(format);
  }
  // A guess of 39 MB.
  EXPECT_EQ(code_of(MeshFormat::kObj, 20'000'000), std::nullopt);
  parameters.glb_codec = GlbCodec::kNone;
  EXPECT_EQ(code_of(MeshFormat::kGlb, 24'000'000), ErrorCode::kTooLarge);
  EXPECT_EQ(code_of(MeshFormat::kGlb, 24'004'000), std::nullopt);
}

TEST_F(EstimateTest, CountsTheCapsOfASurfaceThatIsClosed) {
  const Volume volume = add(test::constant<std::uint8_t>(7, {5, 4, 3}), SampleType::kUint8);
  JobParameters parameters = parameters_of(volume, 7);
  EXPECT_EQ(estimator_.estimate("", parameters).triangles, 0U);
  parameters.close = true;
  EXPECT_GT(exact(parameters).triangles, 0U);
}

TEST_F(EstimateTest, TellsTheSidesOfASurfaceApart) {
  const Volume volume = add_sphere();
  JobParameters parameters = parameters_of(volume, 0);
  parameters.close = true;
  for (const bool regularize : {false, true}) {
    parameters.regularize = regularize;
    parameters.inside = Inside::kAbove;
    const std::uint64_t above = exact(parameters).triangles;
    parameters.inside = Inside::kBelow;
    EXPECT_GT(exact(parameters).triangles, above) << "the box around the sphere has caps";
  }
}

TEST_F(EstimateTest, CountsWhatIsJoined) {
  const Volume volume = add_sphere();
  JobParameters parameters = parameters_of(volume, 0);
  parameters.regularize = false;
  const std::uint64_t plain = estimator_.estimate("", parameters).triangles;
  parameters.regularize = true;
  std::set<std::uint64_t> seen = {plain};
  for (const Interpolation interpolation : {Interpolation::kLinear, Interpolation::kMidpoint}) {
    parameters.interpolation = interpolation;
    const std::uint64_t joined = exact(parameters).triangles;
    EXPECT_LT(3 * joined, plain);
    seen.insert(joined);
  }
  EXPECT_EQ(seen.size(), 3U);  // none is taken for another's count
}

TEST_F(EstimateTest, CountsWhatIsJoinedOfLabels) {
  const Volume volume =
      add(test::noise<std::uint8_t>({0, 0, 0, 1, 2, 2, 3}, {14, 13, 12}, 9), SampleType::kUint8);
  JobParameters parameters = label_parameters({});
  parameters.volume = volume.id;
  parameters.formats = {MeshFormat::kGlb};
  std::set<std::uint64_t> seen;
  for (const bool regularize : {false, true}) {
    parameters.regularize = regularize;
    const Estimate estimate = exact(parameters);
    EXPECT_EQ(estimate.labels.size(), 3U);
    seen.insert(estimate.triangles);
  }
  EXPECT_EQ(seen.size(), 2U);
}

TEST_F(EstimateTest, IsOfTheBoxThatAJobIsCroppedTo) {
  const Volume volume = add_sphere();
  JobParameters parameters = parameters_of(volume, 0);
  const std::uint64_t whole = estimator_.estimate("", parameters).triangles;
  parameters.crop = Box{{{0, 0, 0}, {12, 100, 100}}};
  parameters.close = true;
  EXPECT_NE(exact(parameters).triangles, whole);
}

// The samples in the box are copied, and the copy is not mapped from a file as the volume is.
TEST_F(EstimateTest, IsOfTheCopyOfTheBoxToo) {
  const Volume volume = add_sphere();
  JobParameters parameters = parameters_of(volume, 0);
  const std::uint64_t whole = estimator_.estimate("", parameters).memory_bytes;
  parameters.crop = Box{{{-1e3, -1e3, -1e3}, {1e3, 1e3, 1e3}}};
  EXPECT_EQ(estimator_.estimate("", parameters).memory_bytes,
            whole + volume.sample_count() * bytes_per_sample(volume.type));
}

TEST_F(EstimateTest, OfFewerTrianglesSaysAboutHowMany) {
  const Volume volume = add_sphere();
  JobParameters parameters = parameters_of(volume, 0);
  const Estimate all = estimator_.estimate("", parameters);
  EXPECT_FALSE(all.simplified_triangles);
  parameters.triangles = 100;
  const Estimate few = estimator_.estimate("", parameters);
  EXPECT_EQ(few.triangles, all.triangles);
  EXPECT_EQ(few.simplified_triangles, 100U);
  EXPECT_LT(few.bytes.at(MeshFormat::kDrc), all.bytes.at(MeshFormat::kDrc));
  EXPECT_GT(few.memory_bytes, all.memory_bytes);
}

// Three values are no mask, so only some jobs look for cavities.
TEST_F(EstimateTest, HasTheSearchForCavitiesOfJobsThatMakeIt) {
  const Volume volume =
      add(test::noise<std::uint8_t>({0, 1, 2}, {40, 40, 40}, 3), SampleType::kUint8);
  JobParameters parameters = parameters_of(volume, 1);
  parameters.passes = 0;
  parameters.formats = {MeshFormat::kStl};
  const Estimate without = estimator_.estimate("", parameters);
  parameters.components.keep = 1;
  const Estimate with = estimator_.estimate("", parameters);
  EXPECT_EQ(with.vertices, without.vertices);
  EXPECT_GT(with.memory_bytes, without.memory_bytes + 40 * with.vertices);
  const Volume mask = add(test::noise<std::uint8_t>({0, 1}, {40, 40, 40}, 3), SampleType::kUint8);
  parameters = parameters_of(mask, 1);
  parameters.passes = 0;
  parameters.formats = {MeshFormat::kStl};
  const Estimate of_mask = estimator_.estimate("", parameters);
  parameters.components.keep = 1;
  EXPECT_EQ(estimator_.estimate("", parameters).memory_bytes, of_mask.memory_bytes);
}

TEST_F(EstimateTest, OtsuIsTheVolumesOwn) {
  const Volume volume = add_sphere();
  JobParameters parameters = parameters_of(volume, 0);
  parameters.iso.reset();
  EXPECT_EQ(estimator_.estimate("", parameters).iso, volume.suggested_iso);
}

TEST_F(EstimateTest, NoSurfaceTakesNothing) {
  const Estimate estimate = estimator_.estimate("", parameters_of(add_sphere(), 1e9));
  EXPECT_EQ(estimate.triangles, 0U);
  EXPECT_TRUE(estimate.fits);
}

TEST_F(EstimateTest, SaysWhatOneJobMayNotTake) {
  EXPECT_TRUE(estimator_.estimate("", parameters_of(add_sphere(), 0)).fits);
  EXPECT_FALSE(estimator_.estimate("", parameters_of(add_much(), 50)).fits);
}

TEST_F(EstimateTest, SaysHowLongTheQueueIs) {
  const JobParameters parameters = parameters_of(add_sphere(), 0);
  jobs_.submit({"", parameters, "", ""});
  jobs_.submit({"", parameters, "", ""});
  EXPECT_EQ(estimator_.estimate("", parameters).queue, (Estimate::Queue{2, 0}));
  jobs_.claim("worker", std::chrono::minutes(1));
  EXPECT_EQ(estimator_.estimate("", parameters).queue, (Estimate::Queue{1, 1}));
}

TEST_F(EstimateTest, RefusesWhatIsNotThereOrHasStopped) {
  JobParameters unknown;
  unknown.volume = "0123";
  unknown.iso = 1;
  EXPECT_EQ(test::code_thrown_by([&] { estimator_.estimate("", unknown); }), ErrorCode::kNotFound);
  const Volume volume = add_sphere();
  estimator_.stop();
  EXPECT_TRUE(test::code_thrown_by([&] { estimator_.estimate("", parameters_of(volume, 0)); }));
}

// The model learns from jobs on them.
TEST_F(EstimateTest, VolumesThatAreDamagedOrGoneSpoilNoOthers) {
  const auto ball = [](double radius) {
    return test::sample<std::uint8_t>(test::scaled(test::sphere({5.5, 5.5, 5.5}, radius), 20, 100),
                                      {12, 12, 12});
  };
  const Volume gone = add(ball(3), SampleType::kUint8);
  const Volume damaged = add(ball(4), SampleType::kUint8);
  const JobParameters parameters = parameters_of(add(ball(5), SampleType::kUint8), 100);
  for (const Volume& volume : {gone, damaged}) EXPECT_TRUE(run(parameters_of(volume, 100)).mesh);
  const Estimate before = estimator_.estimate("", parameters);
  database_.change(store::Change::kNew, [&](store::SqlTransaction& transaction) {
    transaction.connection().run("UPDATE volumes SET record = '#' WHERE id = ?1", damaged.id);
    transaction.commit();
    return 0;
  });
  // Its record is still there when the volumes of the jobs are looked up.
  class Erasing : public store::SqlVolumeStore {
   public:
    Erasing(store::SqlDatabase& database, std::string id)
        : SqlVolumeStore(database), id_(std::move(id)) {}
    Volume get(const store::Viewer& viewer, const std::string& id) const override {
      if (id == id_) throw Error(ErrorCode::kGone, "the volume has expired");
      return SqlVolumeStore::get(viewer, id);
    }

   private:
    const std::string id_;
  };
  const Erasing volumes(database_, gone.id);
  Estimator estimator(volumes, blobs_, jobs_, {.memory_bytes = 4 << 20}, job_program());
  const Estimate after = estimator.estimate("", parameters);
  EXPECT_EQ(after.triangles, before.triangles);
  EXPECT_NE(after.milliseconds, before.milliseconds) << "nothing was learnt before";
}

// Whatever it does to the process that counts.
TEST_F(EstimateTest, SamplesThatAreCutMeanwhileAreDamaged) {
  const Volume volume = add_much();
  const test::CutBlobs cut(data_);
  Estimator estimator(volumes_, cut, jobs_, {}, job_program());
  EXPECT_EQ(test::code_thrown_by([&] { estimator.estimate("", parameters_of(volume, 50)); }),
            ErrorCode::kUnusableVolume);
}

TEST_F(EstimateTest, AProcessThatDiesIsToldAndReplaced) {
  const Volume volume = add_sphere();
  Estimator faulty(volumes_, blobs_, jobs_, {}, job_program(FAULTY_JOB));
  const Error error =
      test::error_of([&] { faulty.estimate("", parameters_of(volume, test::kKilled)); });
  EXPECT_THAT(error.what(), testing::HasSubstr("with signal 9 (killed)"));
  EXPECT_EQ(faulty.estimate("", parameters_of(volume, test::kAnswers)).triangles, 0U);
}

TEST_F(EstimateTest, JobsOfOthersShiftNothing) {
  const Volume volume = add_sphere();
  volumes_.add("other", volume);
  const JobParameters parameters = parameters_of(volume, 0);
  const Estimate before = estimator_.estimate("", parameters);
  jobs_.submit({"other", parameters, "", ""});
  JobParameters waiting = parameters;
  waiting.passes += 1;
  jobs_.submit({"other", waiting, "", ""});
  const auto lease = jobs_.claim("worker", std::chrono::minutes(1));
  ASSERT_TRUE(lease);
  EXPECT_EQ(estimator_.estimate("", parameters).queue, Estimate::Queue{});
  EXPECT_EQ(estimator_.estimate("other", parameters).queue, (Estimate::Queue{1, 1}));
  EXPECT_EQ(estimator_.estimate(std::nullopt, parameters).queue, (Estimate::Queue{1, 1}));
  store::Outcome outcome;
  outcome.mesh.emplace().triangles = before.triangles;
  outcome.timing.encode = 1e7;
  ASSERT_TRUE(jobs_.finish(*lease, outcome));
  EXPECT_EQ(estimator_.estimate("", parameters).milliseconds, before.milliseconds);
  EXPECT_NE(estimator_.estimate("other", parameters).milliseconds, before.milliseconds);
}

TEST(CostModel, FollowsTheJobsThatItHasSeen) {
  const SurfaceSize surface = {1'000'000, 500'000};
  JobParameters parameters;
  const double first = CostModel().milliseconds(surface, surface, {1000}, parameters);
  const auto bytes = CostModel().file_bytes(MeshFormat::kDrc, surface, parameters);
  Job job;
  job.parameters = parameters;
  job.timing.encode = 3000;
  job.timing.smooth = 500;
  job.timing.extract = 100;
  job.mesh.emplace();
  job.mesh->triangles = surface.triangles;
  job.mesh->vertices = surface.vertices;
  job.mesh->files[MeshFormat::kDrc] = {3'000'000, "", ""};
  job.mesh->files[MeshFormat::kStl] = {84 + 50'000'000, "", ""};
  CostModel slower;
  for (int n = 0; n < 20; ++n) slower.learn(job, {1000});
  EXPECT_NEAR(slower.milliseconds(surface, surface, {1000}, parameters), 3600, 400);
  EXPECT_GT(slower.milliseconds(surface, surface, {1000}, parameters), first);
  EXPECT_NEAR(static_cast<double>(slower.file_bytes(MeshFormat::kDrc, surface, parameters)), 3e6,
              2e5);
  EXPECT_LT(bytes, 2'500'000U);
  EXPECT_EQ(slower.file_bytes(MeshFormat::kStl, surface, parameters), 50'000'084U);
}

TEST(CostModel, OneSlowJobSaysLittle) {
  const SurfaceSize surface = {2'000'000, 1'000'000};
  const JobParameters parameters;
  const auto learned = [&](const std::vector<double>& slowness) {
    CostModel costs;
    for (const double times : slowness) {
      Job job;
      job.parameters = parameters;
      job.mesh.emplace();
      job.mesh->triangles = surface.triangles;
      job.mesh->vertices = surface.vertices;
      for (const StageRow& row : kStages) {
        if (row.elapsed != nullptr) job.timing.*row.elapsed = 100 * times;
      }
      costs.learn(job, {1000});
    }
    return costs.milliseconds(surface, surface, {1000}, parameters);
  };
  const double usual = learned({1, 1, 1, 1, 1});
  EXPECT_LT(learned({300, 1, 1, 1, 1}), 2.5 * usual);
  EXPECT_LT(learned({1, 1, 1, 1, 300}), 2.5 * usual);
  // A machine that makes all of them slow is learned all the same.
  EXPECT_GT(learned({30, 30, 30, 30, 30, 30, 30, 30}), 10 * usual);
}

TEST(CostModel, LearnsWhatAnErrorLeaves) {
  const SurfaceSize surface = {1'000'000, 500'000};
  JobParameters parameters;
  parameters.max_error_mm = 0.1;
  parameters.certify = true;
  const SurfaceSize first = CostModel().simplified(surface, parameters, 1);
  EXPECT_LT(first.triangles, surface.triangles);
  EXPECT_LT(CostModel().simplified(surface, parameters, 0.5).triangles, first.triangles);
  Job job;
  job.parameters = parameters;
  job.timing = {.extract = 100, .smooth = 100, .simplify = 30'000, .encode = 100, .certify = 9000};
  job.mesh.emplace();
  job.mesh->triangles = 150'000;
  job.mesh->vertices = 75'000;
  job.mesh->simplified = {.triangles_before = 1'000'000};
  CostModel costs;
  for (int n = 0; n < 20; ++n) costs.learn(job, {1000});
  const SurfaceSize later = costs.simplified(surface, parameters, 1);
  EXPECT_NEAR(static_cast<double>(later.triangles), 150'000, 10'000);
  EXPECT_NEAR(costs.milliseconds(surface, later, {1000}, parameters), 39'300, 3000);
  parameters.triangles = 1000;
  EXPECT_EQ(costs.simplified(surface, parameters, 1).triangles, 1000U);
}

TEST(CostModel, FilesThatHoldTheMeshExactlyAreCertifiedOnce) {
  const SurfaceSize surface = {1'000'000, 500'000};
  const auto certifying_ms = [&](const std::vector<MeshFormat>& formats) {
    JobParameters parameters;
    parameters.formats = formats;
    const double without = CostModel().milliseconds(surface, surface, {1000}, parameters);
    parameters.certify = true;
    return CostModel().milliseconds(surface, surface, {1000}, parameters) - without;
  };
  const double once = certifying_ms({MeshFormat::kStl});
  EXPECT_NEAR(certifying_ms({MeshFormat::kStl, MeshFormat::kPly, MeshFormat::kObj}), once, 1e-6);
  EXPECT_NEAR(certifying_ms({MeshFormat::kDrc}), once, 1e-6);
  EXPECT_NEAR(certifying_ms({MeshFormat::kDrc, MeshFormat::kStl, MeshFormat::kGlb}), 3 * once,
              1e-6);
}

// By which owners take turns.
TEST(ExpectedTime, GrowsWithTheVolumeAndWithWhatIsAsked) {
  Volume volume;
  volume.dims = {100, 100, 100};
  const double least = expected_ms(volume, {});
  EXPECT_GT(least, 0);
  const auto with = [&](const auto& change) {
    JobParameters parameters;
    change(parameters);
    return expected_ms(volume, parameters);
  };
  EXPECT_GT(with([](JobParameters& all) { all.passes = 100; }), least);
  EXPECT_GT(with([](JobParameters& all) { all.certify = true; }), least);
  EXPECT_GT(with([](JobParameters& all) { all.min_thickness_mm = 0.4; }), least);
  EXPECT_GT(with([](JobParameters& all) { all.max_error_mm = 0.1; }), least);
  EXPECT_LT(with([](JobParameters& all) { all.crop = {{{0, 0, 0}, {10, 10, 10}}}; }), least);
  const double all_of_it = with([](JobParameters& all) {
    all.crop = {{{-500, -500, -500}, {500, 500, 500}}};
  });
  EXPECT_EQ(all_of_it, least);
  volume.dims = {200, 200, 200};
  EXPECT_GT(expected_ms(volume, {}), 3 * least);
}

// Measured: at any uneven spacing a certificate takes some 2.4 times as long, and nothing else.
TEST(ExpectedTime, GrowsALittleWithUnevenSpacing) {
  Volume volume;
  volume.dims = {100, 100, 100};
  const auto certify_ms = [&](double spacing_mm) {
    volume.geometry.spacing = {spacing_mm, 0.5, 0.5};
    const Timing times = expected_times(volume, {}, {.certify = true});
    EXPECT_EQ(times.extract, expected_times(volume, {}, {}).extract);
    return times.certify;
  };
  const double even = certify_ms(0.5);
  EXPECT_GT(certify_ms(2), 1.2 * even);
  EXPECT_LT(certify_ms(2), 1.8 * even);
  EXPECT_NEAR(certify_ms(500), 2.4 * even, 0.1 * even);
  EXPECT_EQ(certify_ms(1e6), certify_ms(500));
  EXPECT_EQ(certify_ms(1e-6), certify_ms(500));
}

// Estimates, turns and progress have one model.
TEST(Progress, AStageHasItsShareOfTheExpectedTime) {
  Volume volume;
  volume.dims = {100, 100, 100};
  JobParameters parameters;
  parameters.certify = true;
  const Timing expected = expected_times(volume, parameters, parameters);
  double done = 0;
  const Report report = [&](Stage, double share, const Timing&) { done = share; };
  Progress progress({}, report, expected);
  progress.enter(Stage::kLoad);
  progress.enter(Stage::kExtract);
  EXPECT_NEAR(done, expected.load / expected_ms(volume, parameters), 1e-9);
  progress.enter(Stage::kSmooth);
  progress.enter(Stage::kEncode);
  progress.enter(Stage::kCertify);
  EXPECT_NEAR(done, 1 - expected.certify / expected_ms(volume, parameters), 1e-9);
  progress.context().progress(1);
  EXPECT_NEAR(done, 1, 1e-9);
}

TEST(CostModel, LevelsOfDetailTakeTime) {
  JobParameters parameters;
  parameters.formats = {MeshFormat::kGlb};
  const SurfaceSize surface = {1'000'000, 500'000};
  const CostModel model;
  const double without = model.milliseconds(surface, surface, {1'000}, parameters);
  parameters.lods = {1, 0.25};
  EXPECT_GT(model.milliseconds(surface, surface, {1'000}, parameters), 2 * without);
}

TEST(CostModel, AJobWithoutARunTeachesNothing) {
  Job job;
  job.mesh.emplace();
  job.mesh->triangles = 1'000'000;
  CostModel costs;
  costs.learn(job, {1000});
  EXPECT_EQ(costs.milliseconds({1000, 500}, {1000, 500}, {1000}, {}),
            CostModel().milliseconds({1000, 500}, {1000, 500}, {1000}, {}));
}

using HistogramsTest = test::JobsFixture;

// Mapped, they would end the whole service.
TEST_F(HistogramsTest, SamplesThatAreCutMeanwhileAreDamaged) {
  const Volume volume = add_much();
  const test::CutBlobs cut(data_);
  Histograms histograms(cut);
  EXPECT_EQ(test::code_thrown_by([&] { histograms.of("", volume, 2); }),
            ErrorCode::kUnusableVolume);
}

// An answer that comes at once would tell that somebody else has the volume, too.
TEST_F(HistogramsTest, AreCountedForEachViewer) {
  const Volume volume = add_sphere();
  Histograms histograms(blobs_);
  histograms.of("one", volume, 2);
  blobs_.erase(volume.samples);
  EXPECT_NO_THROW(histograms.of("one", volume, 3));
  EXPECT_TRUE(test::code_thrown_by([&] { histograms.of("other", volume, 2); }));
  EXPECT_TRUE(test::code_thrown_by([&] { histograms.of(std::nullopt, volume, 2); }));
}

}  // namespace
}  // namespace isomesh::jobs
