// Jobs by labels, from stored samples to stored files.
#include <cmath>
#include <map>
#include <string>
#include <utility>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "base/sha256.h"
#include "proto/json.h"
#include "server/jobs/library/complete_labels.h"
#include "server/jobs/library/label_lists.h"
#include "server/jobs/library/label_pages.h"
#include "server/jobs/library/label_samples.h"
#include "server/jobs/making/mesh_cost.h"
#include "server/jobs/queue/estimate.h"
#include "server/jobs/queue/pipeline.h"
#include "server/store/job_rules.h"
#include "tests/support/errors.h"
#include "tests/support/step.h"
#include "tests/unit/jobs/fixture.h"

namespace isomesh::jobs {
namespace {

using testing::HasSubstr;

class LabelJobsTest : public test::PipelineFixture {
 protected:
  // Two balls, 3 and 7, that touch, and a cube, 9, apart; spacing 0.5, 1, 2.
  Volume add_labels() {
    auto samples = test::constant<std::int16_t>(0, {40, 24, 20});
    samples.geometry.spacing = {0.5, 1, 2};
    for (std::uint32_t k = 0; k < 20; ++k) {
      for (std::uint32_t j = 0; j < 24; ++j) {
        for (std::uint32_t i = 0; i < 40; ++i) {
          const auto inside = [&](double x, double y, double z, double r) {
            return std::hypot(i - x, j - y, k - z) < r;
          };
          if (inside(10, 8, 8, 5.5)) samples.at(i, j, k) = 3;
          if (inside(18, 8, 8, 5.5)) samples.at(i, j, k) = 7;
          if (i > 30 && i < 38 && j > 14 && j < 22 && k > 12 && k < 18) samples.at(i, j, k) = 9;
        }
      }
    }
    return add(samples, SampleType::kInt16);
  }

  JobParameters settled(const Volume& volume, JobParameters parameters) {
    parameters.volume = volume.id;
    return complete_labels(std::move(parameters), "", volume, lists_);
  }

  LabelLists lists_{blobs_};
};

TEST_F(LabelJobsTest, MakeEveryLabelsClosedSurface) {
  const Volume volume = add_labels();
  JobParameters parameters = label_parameters({});
  parameters.close = true;
  parameters.formats = {MeshFormat::kGlb, MeshFormat::kStl};
  const PipelineResult result = run(volume, settled(volume, parameters));
  const MeshSummary& mesh = result.mesh;
  ASSERT_EQ(mesh.labels.size(), 3U);
  EXPECT_TRUE(mesh.quality.closed);
  EXPECT_TRUE(mesh.quality.manifold);
  EXPECT_TRUE(mesh.quality.oriented);
  EXPECT_EQ(mesh.components, 3U);
  EXPECT_EQ(mesh.quality.genus, 0);
  const auto counted = lists_.of("", volume, 0).labels;
  double sum = 0;
  std::uint64_t triangles = 0;
  for (std::size_t n = 0; n < 3; ++n) {
    const LabelSummary& label = mesh.labels[n];
    EXPECT_EQ(label.label, counted[n].label);
    EXPECT_EQ(label.voxels, counted[n].voxels);
    EXPECT_EQ(label.voxels_mm3, counted[n].volume_mm3);
    EXPECT_NEAR(label.volume_mm3, label.voxels_mm3, 0.05 * label.voxels_mm3);
    EXPECT_TRUE(label.closed && label.manifold && label.oriented);
    EXPECT_EQ(label.files.at(MeshFormat::kStl).bytes, 84 + 50 * label.triangles);
    sum += label.volume_mm3;
    triangles += label.triangles;
  }
  EXPECT_NEAR(mesh.volume_mm3.smoothed, sum, 1e-6 * sum);
  EXPECT_LT(mesh.triangles, triangles);  // the wall between 3 and 7 counts once
  EXPECT_GT(mesh.displacement_mm.max, 0);
  EXPECT_EQ(mesh.files.size(), 2U);
  EXPECT_TRUE(mesh.files.contains(MeshFormat::kZip));
  const std::string zip = blob(mesh.files.at(MeshFormat::kZip).sha256);
  const LabelFile& file = mesh.labels[1].files.at(MeshFormat::kStl);
  EXPECT_EQ(zip.substr(file.offset, 7), "isomesh");
}

TEST_F(LabelJobsTest, OfOneLabelAreThoseOfItsIsoValueAtMidpoints) {
  const Volume volume = add_sphere();
  auto samples = test::constant<std::uint8_t>(0, {20, 18, 16});
  for (std::size_t n = 0; n < samples.samples.size(); n += 3) samples.samples[n] = 1;
  const Volume two = add(samples, SampleType::kUint8);
  JobParameters labels = label_parameters({});
  labels.formats = {MeshFormat::kStl};
  labels.passes = 3;
  labels.smoothing = Smoothing::kLaplacian;
  labels.regularize = false;
  labels.lambda = 1;
  labels.max_displacement_mm = 100;
  const PipelineResult by_label = run(two, settled(two, labels));
  JobParameters iso = parameters_of(two, 0.5);
  iso.interpolation = Interpolation::kMidpoint;
  iso.regularize = false;
  iso.formats = {MeshFormat::kStl};
  iso.passes = 3;
  iso.max_displacement_mm = 100;
  const PipelineResult by_iso = run(two, iso);
  const std::string zip = blob(by_label.mesh.files.at(MeshFormat::kZip).sha256);
  const LabelFile& file = by_label.mesh.labels.front().files.at(MeshFormat::kStl);
  EXPECT_EQ(zip.substr(file.offset, file.bytes),
            blob(by_iso.mesh.files.at(MeshFormat::kStl).sha256));
  EXPECT_EQ(by_label.mesh.triangles, by_iso.mesh.triangles);
  EXPECT_EQ(by_label.mesh.volume_mm3.extracted, by_iso.mesh.volume_mm3.extracted);
}

TEST_F(LabelJobsTest, JoinVerticesAndKeepEveryLabelsTopology) {
  const Volume volume =
      add(test::noise<std::uint8_t>({0, 0, 0, 1, 2, 2, 3}, {9, 8, 7}, 9), SampleType::kUint8);
  for (const bool close : {false, true}) {
    JobParameters parameters = settled(volume, label_parameters({}));
    parameters.formats = {MeshFormat::kGlb};
    parameters.close = close;
    parameters.regularize = false;
    const MeshSummary plain = run(volume, parameters).mesh;
    parameters.regularize = true;
    const MeshSummary joined = run(volume, parameters).mesh;
    EXPECT_LT(joined.triangles, plain.triangles);
    EXPECT_TRUE(joined.quality.manifold && joined.quality.oriented);
    EXPECT_EQ(joined.quality.closed, close);
    EXPECT_EQ(joined.components, plain.components);
    EXPECT_EQ(joined.euler, plain.euler);
    EXPECT_EQ(joined.boundary_edges, plain.boundary_edges);
  }
}

TEST_F(LabelJobsTest, LabelsThatAreNotChosenAreBackground) {
  const Volume volume = add_labels();
  JobParameters parameters = label_parameters({{3}});
  parameters.formats = {MeshFormat::kZip};
  const MeshSummary mesh = run(volume, settled(volume, parameters)).mesh;
  ASSERT_EQ(mesh.labels.size(), 1U);
  EXPECT_EQ(mesh.labels[0].triangles, mesh.triangles);
  EXPECT_TRUE(mesh.labels[0].files.contains(MeshFormat::kStl));
}

TEST_F(LabelJobsTest, AreSettledByWhatTheVolumeSays) {
  Volume volume = add_labels();
  volume.labels = {{.label = 3, .name = "Liver", .color = "#112233"},
                   {.label = 5, .name = "Both", .values = {3, 7}},
                   {.label = 9, .name = "Bone"}};
  JobParameters parameters = label_parameters({});
  parameters.label_names = {{9, "Mine"}, {44, "Nobody"}};
  const JobParameters all = settled(volume, parameters);
  EXPECT_EQ(all.label_names, (LabelTexts{{5, "Both"}, {9, "Mine"}}));
  EXPECT_FALSE(all.max_displacement_mm);
  EXPECT_TRUE(all.label_values.empty());

  parameters.smoothing = Smoothing::kLaplacian;
  EXPECT_EQ(settled(volume, parameters).max_displacement_mm, 0.25);

  parameters.labels = LabelChoice{{9}};
  const JobParameters one = settled(volume, parameters);
  EXPECT_EQ(one.label_names, (LabelTexts{{9, "Mine"}}));
  EXPECT_TRUE(one.label_values.empty());
  EXPECT_TRUE(one.label_colors.empty());
}

TEST_F(LabelJobsTest, ThatOverlapAreMadeWhole) {
  Volume volume = add_labels();
  volume.labels = {{.label = 1, .values = {3, 7}}, {.label = 2, .values = {7}}};
  JobParameters parameters = label_parameters({{1, 2}});
  parameters.close = true;
  const MeshSummary mesh = run(volume, settled(volume, parameters)).mesh;
  ASSERT_EQ(mesh.labels.size(), 2U);
  EXPECT_GT(mesh.labels[0].voxels, mesh.labels[1].voxels);
  for (const LabelSummary& label : mesh.labels) {
    EXPECT_TRUE(label.closed && label.manifold && label.oriented);
    EXPECT_NEAR(label.volume_mm3, label.voxels_mm3, 0.05 * label.voxels_mm3);
  }
  EXPECT_NEAR(mesh.volume_mm3.smoothed, mesh.labels[0].volume_mm3, 1e-6 * mesh.volume_mm3.smoothed);
}

// The number of voxels of each label of a job.
std::map<std::int64_t, std::uint64_t> voxels_of(const MeshSummary& mesh) {
  std::map<std::int64_t, std::uint64_t> voxels;
  for (const LabelSummary& label : mesh.labels) voxels[label.label] = label.voxels;
  return voxels;
}

// The samples are a cube of two halves. Simplifying its mesh changes no count.
TEST_F(LabelJobsTest, CountTheFacesThatTheirSamplesShare) {
  auto samples = test::constant<std::uint8_t>(0, {8, 8, 8});
  for (std::uint32_t k = 1; k < 7; ++k) {
    for (std::uint32_t j = 1; j < 7; ++j) {
      for (std::uint32_t i = 1; i < 7; ++i) samples.at(i, j, k) = i < 4 ? 1 : 2;
    }
  }
  const Volume volume = add(samples, SampleType::kUint8);
  const auto faces = [&](const JobParameters& parameters) {
    Job job;
    job.parameters = parameters;
    job.mesh = run(volume, parameters).mesh;
    std::map<std::pair<std::int64_t, std::int64_t>, std::uint64_t> found;
    for (const WallSummary& wall : walls_of(job, 0, true, blobs_).walls) {
      found[{wall.a, wall.b.value_or(0)}] = wall.faces.value_or(0);
    }
    EXPECT_EQ(job.mesh->walls_count, found.size());
    EXPECT_EQ(job.mesh->edge_contacts_count, 0U);
    return found;
  };
  using Faces = std::map<std::pair<std::int64_t, std::int64_t>, std::uint64_t>;
  JobParameters parameters = label_parameters({});
  EXPECT_EQ(faces(parameters), (Faces{{{1, 0}, 108}, {{1, 2}, 36}, {{2, 0}, 108}}));
  parameters.triangles = 60;
  EXPECT_EQ(faces(parameters), (Faces{{{1, 0}, 108}, {{1, 2}, 36}, {{2, 0}, 108}}));
  parameters.crop = Box{{{0, 0, 0}, {7, 3, 7}}};
  EXPECT_EQ(faces(parameters), (Faces{{{1, 0}, 54}, {{1, 2}, 18}, {{2, 0}, 54}}));
  parameters.close = true;
  EXPECT_EQ(faces(parameters), (Faces{{{1, 0}, 72}, {{1, 2}, 18}, {{2, 0}, 72}}));
  JobParameters joined = label_parameters({{50}});
  joined.label_values = {{50, {1, 2}}};
  EXPECT_EQ(faces(joined), (Faces{{{50, 0}, 216}}));
}

// Labels of 64 bits were numbered from 1, but requests do not know that.
TEST_F(LabelJobsTest, JoinLabelsThatTheListsOfTheVolumeHave) {
  const std::int64_t wide = std::int64_t{1} << 60;
  Volume volume = add_labels();
  volume.labels = {
      {.label = 3, .values = {7}}, {.label = 7, .values = {9}}, {.label = wide, .values = {3}}};
  const auto own = voxels_of(run(volume, settled(volume, label_parameters({}))).mesh);
  ASSERT_EQ(own.size(), 3U);
  const auto joined = [&](const LabelValues& lists, const LabelChoice& labels) {
    JobParameters parameters = label_parameters(labels);
    parameters.label_values = lists;
    const JobParameters once = settled(volume, parameters);
    EXPECT_EQ(settled(volume, once), once);  // as a page sends it again
    return voxels_of(run(volume, once).mesh);
  };
  using Voxels = std::map<std::int64_t, std::uint64_t>;
  EXPECT_EQ(joined({{50, {3}}}, {{50}}), (Voxels{{50, own.at(3)}}));
  EXPECT_EQ(joined({{50, {3, wide}}}, {}),
            (Voxels{{7, own.at(7)}, {50, own.at(3) + own.at(wide)}}));
  EXPECT_EQ(joined({{3, {7}}}, {}), (Voxels{{3, own.at(7)}, {wide, own.at(wide)}}));
  EXPECT_EQ(joined({{50, {9}}}, {}), own);  // a number of samples, but no label
}

// Version 8 completed each job by the samples of its labels.
TEST_F(LabelJobsTest, OfAnOlderVersionHaveTheirSamplesInTheirLists) {
  Volume volume = add_labels();
  volume.labels = {{.label = 1, .values = {1, 3}}, {.label = 2, .values = {3}}};
  JobParameters parameters = label_parameters({});
  const LabelValues own = with_label_samples(parameters, volume).label_values;
  ASSERT_EQ(own, (LabelValues{{1, {1, 3}}, {2, {3}}}));
  parameters.label_values = own;
  EXPECT_EQ(with_label_samples(parameters, volume).label_values, own);
  parameters.label_values = {{1, {1, 3}}, {2, {3}}, {50, {1}}};  // one that the request had
  EXPECT_EQ(with_label_samples(parameters, volume).label_values, parameters.label_values);
  parameters.labels = LabelChoice{{2}};
  parameters.label_values = {{2, {3}}};
  EXPECT_EQ(with_label_samples(parameters, volume).label_values, parameters.label_values);
}

TEST_F(LabelJobsTest, JoinSegmentsWithTheirOverlap) {
  Volume volume = add_labels();
  volume.labels = {{.label = 1, .values = {3, 7}}, {.label = 2, .values = {7, 9}}};
  const auto own = voxels_of(run(volume, settled(volume, label_parameters({}))).mesh);
  std::uint64_t all = 0;
  const auto counts = lists_.counts("", volume);
  for (const mesh::LabelVoxels& value : *counts) all += value.label == 0 ? 0 : value.voxels;
  ASSERT_LT(all, own.at(1) + own.at(2));
  JobParameters parameters = label_parameters({});
  parameters.label_values = {{50, {1, 2}}};
  const auto joined = voxels_of(run(volume, settled(volume, parameters)).mesh);
  EXPECT_EQ(joined, (std::map<std::int64_t, std::uint64_t>{{50, all}}));

  // 7 is the number of the overlap. As a background, it would take that from both.
  parameters.label_values.clear();
  parameters.background = 7;
  EXPECT_EQ(test::code_thrown_by([&] { settled(volume, parameters); }),
            ErrorCode::kInvalidParameter);
  EXPECT_EQ(test::code_thrown_by([&] { lists_.of("", volume, 7); }), ErrorCode::kInvalidParameter);
}

// Their samples are the same, and so are the requests.
TEST_F(LabelJobsTest, OfOtherTablesShareNoResult) {
  Volume volume = add_labels();
  volume.labels = {{.label = 1, .values = {3, 7}}};
  const JobParameters parameters = settled(volume, label_parameters({}));
  const std::string key = store::result_key(volume, parameters, "1");
  volume.labels[0].values = {3};
  EXPECT_NE(store::result_key(volume, settled(volume, label_parameters({})), "1"), key);
}

// Each has a surface of its own, of the same walls.
TEST_F(LabelJobsTest, ThatOverlapTakeTheMemoryOfAllTheirSurfaces) {
  const mesh::SurfaceSize walls = {.triangles = 1'000'000, .vertices = 500'000};
  const JobParameters parameters = label_parameters({});
  const std::uint64_t usual = estimate_memory(walls, 0, parameters, {});
  EXPECT_EQ(estimate_memory(walls, 0, parameters, {}, {.of_labels = 2 * walls.triangles}), usual);
  EXPECT_GT(estimate_memory(walls, 0, parameters, {}, {.of_labels = 60 * walls.triangles}),
            58 * walls.triangles * (sizeof(mesh::Triangle) + sizeof(mesh::Vec3) / 2));

  Volume volume = add_labels();
  volume.labels.clear();
  for (std::int64_t n = 1; n <= 60; ++n) volume.labels.push_back({.label = n, .values = {3, 7}});
  JobParameters some = settled(volume, label_parameters({}));
  some.formats = {MeshFormat::kGlb};
  const PipelineLimits limits = {.memory_bytes = std::uint64_t{3} << 20};
  EXPECT_EQ(test::code_thrown_by(
                [&] { run_pipeline(volume, some, limits, blobs_, process_, {}, kQuiet); }),
            ErrorCode::kTooLarge);
  some.labels = LabelChoice{{1}};
  run_pipeline(volume, some, limits, blobs_, process_, {}, kQuiet);
}

TEST_F(LabelJobsTest, AreRefusedWithTheReason) {
  const Volume volume = add_labels();
  const auto reason_of = [&](const Volume& of, const LabelChoice& labels) {
    const auto error = test::thrown_by([&] { settled(of, label_parameters(labels)); });
    return error ? std::pair(error->code(), std::string(error->what()))
                 : std::pair(ErrorCode::kInternal, std::string("was taken"));
  };
  const auto [code, text] = reason_of(volume, {{3, 4, 5}});
  EXPECT_EQ(code, ErrorCode::kUnusableVolume);
  EXPECT_THAT(text, HasSubstr("4, 5"));
  const auto [float_code, float_text] = reason_of(add_sphere(), {});
  EXPECT_EQ(float_code, ErrorCode::kUnusableVolume);
  EXPECT_THAT(float_text, HasSubstr("Use an iso-value instead of labels"));
  const Volume empty = add(test::constant<std::uint8_t>(0, {4, 4, 4}), SampleType::kUint8);
  EXPECT_EQ(reason_of(empty, {}).first, ErrorCode::kUnusableVolume);

  // The process finds the same for itself.
  JobParameters unsettled = label_parameters({{4}});
  unsettled.volume = volume.id;
  const Error error = test::error_of([&] { run(volume, unsettled); });
  EXPECT_EQ(error.code(), ErrorCode::kUnusableVolume);
}

// As float masks that nothing else recognised.
TEST_F(LabelJobsTest, OfFloatsAreThoseOfTheirWholeNumbers) {
  auto whole = test::constant<std::uint8_t>(0, {8, 8, 8});
  auto floats = test::constant<float>(0, {8, 8, 8});
  for (std::size_t n = 100; n < 300; ++n) {
    whole.samples[n] = static_cast<std::uint8_t>(n % 8 < 5 ? 3 : 0);
    floats.samples[n] = static_cast<float>(whole.samples[n]) + (n % 2 == 0 ? 0.0005F : -0.0005F);
  }
  const auto meshes = [&](const Volume& volume, std::optional<Box> crop) {
    JobParameters parameters = label_parameters({});
    parameters.crop = crop;
    parameters.formats = {MeshFormat::kGlb};
    return run(volume, settled(volume, parameters)).mesh;
  };
  for (const std::optional<Box>& crop :
       {std::optional<Box>(), std::optional<Box>(Box{{{0, 0, 1}, {7, 7, 4}}})}) {
    const MeshSummary expected = meshes(add(whole, SampleType::kUint8), crop);
    const MeshSummary mesh = meshes(add(floats, SampleType::kFloat32), crop);
    ASSERT_EQ(mesh.labels.size(), 1U);
    EXPECT_EQ(mesh.labels[0].label, 3);
    EXPECT_EQ(mesh.labels[0].voxels, expected.labels[0].voxels);
    EXPECT_EQ(mesh.labels[0].volume_mm3, expected.labels[0].volume_mm3);
    const auto tells = [&](const MeshSummary& of) {
      return blob(of.files.at(MeshFormat::kGlb).sha256).find("labels-rounded") != std::string::npos;
    };
    EXPECT_FALSE(tells(expected));
    EXPECT_TRUE(tells(mesh));
  }
  floats.samples[7] = 0.25;
  const Volume fractions = add(floats, SampleType::kFloat32);
  const Error error = test::error_of([&] {
    run(fractions, [&] {
      JobParameters parameters = label_parameters({});
      parameters.volume = fractions.id;
      return parameters;
    }());
  });
  EXPECT_EQ(error.code(), ErrorCode::kUnusableVolume);
  EXPECT_THAT(error.what(), HasSubstr("one of the samples is 0.25"));
}

TEST_F(LabelJobsTest, MayBeThousands) {
  constexpr std::size_t kValues = 2500 / test::kStep;
  constexpr std::size_t kSide = test::kStep == 1 ? 14 : 8;
  auto samples = test::constant<std::uint16_t>(0, {kSide, kSide, kSide});
  for (std::size_t n = 0; n < samples.samples.size(); ++n) {
    samples.samples[n] = static_cast<std::uint16_t>(n % kValues);
  }
  const Volume volume = add(samples, SampleType::kUint16);
  JobParameters parameters = label_parameters({});
  parameters.formats = {MeshFormat::kStl, MeshFormat::kPly};
  Job job;
  job.id = "many";
  job.mesh = run(volume, settled(volume, parameters)).mesh;
  EXPECT_EQ(job.mesh->labels_count, kValues - 1);
  EXPECT_TRUE(job.mesh->labels.empty());
  EXPECT_LT(to_record(job).size(), std::size_t{64} << 10);
  const JobLabels labels(job, blobs_);
  EXPECT_EQ(labels.after(kValues - 2).size(), 1U);
  const auto label = labels.find(kValues - 1);
  ASSERT_TRUE(label);
  EXPECT_EQ(label->voxels, 1U);  // of fewer samples than twice the values
  EXPECT_EQ(label->files.size(), 2U);
  const LabelFile& file = label->files.at(MeshFormat::kStl);
  const std::string zip = blob(job.mesh->files.at(MeshFormat::kZip).sha256);
  EXPECT_EQ(sha256_of(zip.substr(file.offset, file.bytes)), file.sha256);
  EXPECT_GT(run(add_sphere(), parameters_of(add_sphere(), 0)).mesh.triangles, 0U);  // as ever
}

TEST_F(LabelJobsTest, OfASingleSliceAreRefused) {
  const Volume slice = add(test::constant<std::uint8_t>(1, {10, 10, 1}), SampleType::kUint8);
  const Error error = test::error_of([&] { settled(slice, label_parameters({})); });
  EXPECT_EQ(error.code(), ErrorCode::kUnusableVolume);
  EXPECT_THAT(error.what(), HasSubstr("10 x 10 x 1"));
}

TEST_F(LabelJobsTest, TakeNoMoreMemoryThanTheyMay) {
  const Volume volume = add_labels();
  const Error error = test::error_of([&] {
    run_pipeline(volume, settled(volume, label_parameters({})), {.memory_bytes = 100'000}, blobs_,
                 process_, {}, kQuiet);
  });
  EXPECT_EQ(error.code(), ErrorCode::kTooLarge);
}

// A bound on the distance must not forbid the smoothing that gives labels their volume.
TEST_F(LabelJobsTest, CountTheirErrorFromTheSmoothedSurface) {
  auto samples = test::sample<std::uint8_t>(test::scaled(test::sphere({14.3, 14, 13.8}, 10), 99, 0),
                                            {29, 29, 29});
  for (std::uint8_t& sample : samples.samples) sample = sample > 0 ? 1 : 0;
  const Volume volume = add(samples, SampleType::kUint8);
  JobParameters parameters = label_parameters({});
  parameters.close = true;
  parameters.formats = {MeshFormat::kStl, MeshFormat::kGlb};
  parameters.certify = true;
  const MeshSummary whole = run(volume, settled(volume, parameters)).mesh;
  EXPECT_EQ(whole.certificate.value().reference, MeshCertificate::Reference::kExtracted);
  for (const double error : {0.25, 0.5, 1.0}) {
    parameters.max_error_mm = error;
    const MeshSummary mesh = run(volume, settled(volume, parameters)).mesh;
    // As far as without a bound.
    EXPECT_EQ(mesh.displacement_mm.max, whole.displacement_mm.max);
    EXPECT_LT(mesh.triangles, whole.triangles / 3);
    const LabelSummary& label = mesh.labels.at(0);
    EXPECT_NEAR(label.volume_mm3, label.voxels_mm3, 0.01 * error * label.voxels_mm3);
    const MeshCertificate& certificate = mesh.certificate.value();
    EXPECT_EQ(certificate.reference, MeshCertificate::Reference::kSmoothed);
    ASSERT_TRUE(certificate.bound_mm) << certificate.why_unproven.value_or("");
    EXPECT_LE(*certificate.bound_mm, error);
    EXPECT_LE(certificate.found_mm, *certificate.bound_mm);
    const ErrorBudget& budget = certificate.budget_mm.value();
    EXPECT_EQ(budget.smoothing, 0);
    EXPECT_NEAR(budget.simplification + budget.quantisation, error, 1e-12);
  }
  parameters.max_displacement_mm = 0.1;
  EXPECT_LE(run(volume, settled(volume, parameters)).mesh.displacement_mm.max, 0.1);
  parameters.max_displacement_mm.reset();
  parameters.max_error_mm.reset();
  parameters.triangles = whole.triangles / 10;
  const MeshSummary few = run(volume, settled(volume, parameters)).mesh;
  EXPECT_EQ(few.certificate.value().reference, MeshCertificate::Reference::kSmoothed);
  EXPECT_NEAR(few.labels.at(0).volume_mm3, few.labels.at(0).voxels_mm3,
              0.005 * few.labels.at(0).voxels_mm3);
}

}  // namespace
}  // namespace isomesh::jobs
