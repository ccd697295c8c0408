// Jobs whose error is bound or measured, and what they leave out of the surface.
#include <algorithm>
#include <cstring>
#include <numbers>
#include <string>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "server/codec/formats.h"
#include "server/jobs/queue/estimate.h"
#include "server/jobs/queue/pipeline.h"
#include "server/mesh/measure/distance.h"
#include "tests/support/errors.h"
#include "tests/unit/jobs/fixture.h"

namespace isomesh::jobs {
namespace {

// Two balls and a hollow, in samples of half a millimetre.
test::SampleVolume<float> hollow() {
  const test::Field large = test::sphere({10, 10, 10}, 8.1);
  const test::Field inside = test::sphere({10, 10, 10}, 4.2);
  const test::Field speck = test::sphere({20.5, 10, 10}, 1.4);
  Geometry geometry;
  geometry.spacing = {0.5, 0.5, 0.5};
  return test::sample<float>(
      [&](const test::Point& p) { return std::max(std::min(large(p), -inside(p)), speck(p)); },
      {46, 41, 41}, geometry);
}

struct Soup {
  std::vector<mesh::Vec3> positions;
  std::vector<mesh::Triangle> triangles;

  mesh::SurfaceView view() const { return {positions, triangles}; }
};

class ErrorJobsTest : public test::PipelineFixture {
 protected:
  using PipelineFixture::run;
  MeshSummary run(const JobParameters& parameters) { return run(volume_, parameters).mesh; }

  // Decodes a file whose format rounds coordinates.
  codec::DecodedSurface decoded(const MeshSummary& mesh, MeshFormat format) {
    const std::string bytes = blob(mesh.files.at(format).sha256);
    return codec::decode(std::as_bytes(std::span(bytes)), format, space_of(format, {}), {});
  }

  // The corners in the STL file, three for each triangle.
  Soup stl(const MeshSummary& mesh) {
    constexpr std::size_t kHeaderBytes = 84;
    constexpr std::size_t kFacetBytes = 50;
    const std::string bytes = blob(mesh.files.at(MeshFormat::kStl).sha256);
    Soup soup;
    for (std::size_t at = kHeaderBytes; at < bytes.size(); at += kFacetBytes) {
      const auto first = static_cast<std::uint32_t>(soup.positions.size());
      soup.triangles.push_back({first, first + 1, first + 2});
      soup.positions.resize(first + 3);
      std::memcpy(&soup.positions[first], bytes.data() + at + sizeof(mesh::Vec3),
                  3 * sizeof(mesh::Vec3));
    }
    return soup;
  }

  // The surface as it is extracted.
  // max_error_mm is measured from it. With `joined` it is the surface of a job without
  // max_error_mm.
  Soup extracted(bool joined = false) {
    JobParameters parameters = parameters_of(volume_, 0);
    parameters.regularize = joined;
    parameters.passes = 0;
    parameters.formats = {MeshFormat::kStl};
    return stl(run(parameters));
  }

  Volume volume_ = add(hollow(), SampleType::kFloat32);
};

TEST_F(ErrorJobsTest, KeepEveryFileWithinTheError) {
  const Soup reference = extracted();
  for (const double error : {0.02, 0.1, 0.4}) {
    JobParameters parameters = parameters_of(volume_, 0);
    parameters.formats = {MeshFormat::kDrc, MeshFormat::kGlb, MeshFormat::kStl, MeshFormat::k3mf};
    parameters.max_error_mm = error;
    parameters.certify = true;
    const MeshSummary mesh = run(parameters);
    ASSERT_TRUE(mesh.certificate);
    ASSERT_TRUE(mesh.simplified);
    ASSERT_TRUE(mesh.certificate->bound_mm) << mesh.certificate->why_unproven.value_or("");
    EXPECT_EQ(mesh.certificate->reference, MeshCertificate::Reference::kExtracted);
    EXPECT_LE(*mesh.certificate->bound_mm, error);
    EXPECT_GE(*mesh.certificate->bound_mm, mesh.certificate->found_mm);
    EXPECT_EQ(mesh.simplified->triangles_before, reference.triangles.size());
    EXPECT_EQ(mesh.simplified->bound_by, Simplification::Bound::kError);
    double farthest = 0;
    const auto expect_near = [&](const mesh::SurfaceView& file) {
      EXPECT_EQ(file.triangles.size(), mesh.triangles);
      const double max = certify(file, reference.view(), {}).max_mm();
      EXPECT_LE(max, error);
      farthest = std::max(farthest, max);
    };
    expect_near(decoded(mesh, MeshFormat::kDrc).view());
    expect_near(decoded(mesh, MeshFormat::kGlb).view());
    expect_near(stl(mesh).view());
    EXPECT_DOUBLE_EQ(mesh.certificate->found_mm, farthest);
    const auto& budget = mesh.certificate->budget_mm.value();
    EXPECT_NEAR(budget.smoothing + budget.simplification + budget.quantisation, error, 1e-12);
    EXPECT_LE(budget.smoothing, error / 2);
    EXPECT_LE(budget.quantisation, error / 10);
    EXPECT_EQ(mesh.quality.self_intersections->pairs, 0U);
    EXPECT_TRUE(mesh.quality.closed && mesh.quality.manifold && mesh.quality.oriented);
    EXPECT_TRUE(mesh.quality.encloses_volume);
    EXPECT_EQ(mesh.components, 3U);
    EXPECT_LT(mesh.triangles, reference.triangles.size() / (error < 0.1 ? 1 : 3));
  }
}

TEST_F(ErrorJobsTest, AreProvenWithEachScheme) {
  for (const SchemeName scheme : {SchemeName::kFive, SchemeName::kSix, SchemeName::kBcc}) {
    JobParameters parameters = parameters_of(volume_, 0);
    parameters.scheme = scheme;
    parameters.max_error_mm = 0.1;
    parameters.certify = true;
    const MeshCertificate certificate = run(parameters).certificate.value();
    ASSERT_TRUE(certificate.bound_mm) << certificate.why_unproven.value_or("");
    EXPECT_LE(*certificate.bound_mm, 0.1);
    EXPECT_GE(*certificate.bound_mm, certificate.found_mm);
  }
}

TEST_F(ErrorJobsTest, AreProvenWithoutSomeComponents) {
  const auto components_of = [&](auto change) {
    JobParameters parameters = parameters_of(volume_, 0);
    parameters.max_error_mm = 0.1;
    parameters.certify = true;
    change(parameters);
    const MeshSummary mesh = run(parameters);
    EXPECT_TRUE(mesh.certificate->bound_mm) << mesh.certificate->why_unproven.value_or("");
    EXPECT_LE(mesh.certificate->bound_mm.value_or(1), 0.1);
    EXPECT_LE(mesh.certificate->found_mm, mesh.certificate->bound_mm.value_or(0));
    EXPECT_EQ(mesh.quality.self_intersections->pairs, 0U);
    return mesh.components;
  };
  EXPECT_EQ(components_of([](auto& job) { job.components.keep = 1; }), 1U);
  EXPECT_EQ(components_of([](auto& job) { job.fill_cavities = true; }), 2U);
  EXPECT_EQ(components_of([](auto& job) {
              job.fill_cavities = true;
              job.components.keep = 1;
              job.passes = 5;
            }),
            1U);
}

// If the error cannot be proven, the certificate says why.
TEST_F(ErrorJobsTest, SayWhyTheirErrorIsNotProven) {
  const auto why = [&](auto change) {
    JobParameters parameters = parameters_of(volume_, 0);
    parameters.max_error_mm = 0.1;
    parameters.certify = true;
    change(parameters);
    const MeshCertificate certificate = run(parameters).certificate.value();
    EXPECT_FALSE(certificate.bound_mm);
    EXPECT_LE(certificate.found_mm, parameters.max_error_mm.value_or(1));
    return certificate.why_unproven.value_or("");
  };
  EXPECT_EQ(why([](auto& job) { job.max_error_mm.reset(); }), "A proof needs max_error_mm.");
}

// Their limit is measured from the surface whose vertices are not joined.
TEST_F(ErrorJobsTest, AreTheSameWithAndWithoutRegularize) {
  const auto triangles_with = [&](bool regularize) {
    JobParameters parameters = parameters_of(volume_, 0);
    parameters.max_error_mm = 0.1;
    parameters.regularize = regularize;
    const MeshSummary mesh = run(parameters);
    return std::pair(mesh.triangles, mesh.simplified->triangles_before);
  };
  EXPECT_EQ(triangles_with(true), triangles_with(false));
}

// Draco's default of bits is too few for some micrometres.
TEST_F(ErrorJobsTest, TakeAsManyBitsAsTheErrorNeeds) {
  JobParameters parameters = parameters_of(volume_, 0);
  parameters.max_error_mm = 0.002;
  parameters.certify = true;
  EXPECT_LE(run(parameters).certificate->found_mm, 0.002);
}

TEST_F(ErrorJobsTest, SayWhatTheirTrianglesCost) {
  JobParameters parameters = parameters_of(volume_, 0);
  parameters.formats = {MeshFormat::kStl};
  parameters.triangles = 500;
  parameters.certify = true;
  const MeshSummary mesh = run(parameters);
  EXPECT_LE(mesh.triangles, 500U);
  EXPECT_EQ(mesh.simplified->bound_by, Simplification::Bound::kTriangles);
  EXPECT_DOUBLE_EQ(mesh.certificate->found_mm,
                   certify(stl(mesh).view(), extracted(true).view(), {}).max_mm());
  EXPECT_FALSE(mesh.certificate->budget_mm);
  parameters.max_error_mm = 0.05;  // which 500 triangles cannot keep
  const MeshSummary both = run(parameters);
  EXPECT_GT(both.triangles, 500U);
  EXPECT_EQ(both.simplified->bound_by, Simplification::Bound::kError);
  EXPECT_LE(both.certificate->found_mm, 0.05);
}

TEST_F(ErrorJobsTest, MeasureWithoutChangingAnything) {
  JobParameters parameters = parameters_of(volume_, 0);
  const MeshSummary plain = run(parameters);
  EXPECT_FALSE(plain.certificate || plain.simplified || plain.quality.self_intersections);
  parameters.certify = true;
  const MeshSummary certified = run(parameters);
  EXPECT_EQ(certified.files.at(MeshFormat::kDrc).sha256, plain.files.at(MeshFormat::kDrc).sha256);
  EXPECT_GE(certified.certificate->found_mm, 0.9 * plain.displacement_mm.max / 2);
  EXPECT_TRUE(certified.quality.self_intersections);
}

// The shell's wall is 3.9 mm, and the speck's diameter is 2.8 mm.
TEST_F(ErrorJobsTest, MeasureThicknessWithoutChangingAnything) {
  JobParameters parameters = parameters_of(volume_, 0);
  parameters.passes = 0;  // which would shrink the speck
  parameters.regularize = false;
  const MeshSummary plain = run(parameters);
  EXPECT_FALSE(plain.thickness);
  std::vector<Stage> stages;
  const Report note = [&](Stage stage, double, const Timing&) { stages.push_back(stage); };
  for (const double below : {2.0, 3.2, 5.0}) {
    parameters.min_thickness_mm = below;
    const auto [mesh, timing] = run(volume_, parameters, note);
    EXPECT_EQ(mesh.files.at(MeshFormat::kDrc).sha256, plain.files.at(MeshFormat::kDrc).sha256);
    EXPECT_FALSE(mesh.certificate);
    EXPECT_THAT(stages, testing::Contains(Stage::kThickness));
    EXPECT_GT(timing.thickness, 0);
    const Thickness& thickness = mesh.thickness.value();
    EXPECT_NEAR(thickness.thinnest_mm.value_or(0), 2.8, 0.25);
    EXPECT_GT(thickness.place.value()[0], 19);
    const double speck = 4 * std::numbers::pi * 1.4 * 1.4;
    const double thin = below < 3 ? 0 : below < 4 ? speck : mesh.area_mm2;
    EXPECT_NEAR(thickness.thin_area_mm2, thin, 0.07 * thin);
  }
}

// Each label has its own walls, and one between two labels belongs to both.
TEST_F(ErrorJobsTest, MeasureTheThicknessOfEachLabel) {
  const Volume labels =
      add(test::sample<std::uint8_t>([](const test::Point& p) { return p[2] < 12 ? 1.0 : 2.0; },
                                     {16, 16, 16}),
          SampleType::kUint8);
  JobParameters parameters = label_parameters({});
  parameters.volume = labels.id;
  parameters.close = true;
  parameters.passes = 0;
  parameters.formats = {MeshFormat::kStl};
  parameters.min_thickness_mm = 5;
  const Thickness thickness = run(labels, parameters).mesh.thickness.value();
  EXPECT_NEAR(thickness.thinnest_mm.value_or(0), 4, 0.2);
  EXPECT_GT(thickness.place.value()[2], 11.4);
  EXPECT_NEAR(thickness.thin_area_mm2, 2 * 16 * 16, 60);  // without bevelled edges
}

// All files that round nothing hold the mesh, so they have its certificate, under the first's name.
TEST_F(ErrorJobsTest, MeasureTheMeshOnceForAllFilesThatHoldIt) {
  JobParameters parameters = parameters_of(volume_, 0);
  parameters.max_error_mm = 0.1;
  parameters.certify = true;
  parameters.formats = {MeshFormat::kOff, MeshFormat::kStl, MeshFormat::k3mf};
  const MeshSummary mesh = run(parameters);
  EXPECT_EQ(mesh.certificate->file, MeshFormat::kOff);
  EXPECT_EQ(mesh.certificate->from_mesh.points, mesh.vertices + mesh.triangles);
  const mesh::Certificate again = certify(stl(mesh).view(), extracted().view(), {});
  EXPECT_DOUBLE_EQ(mesh.certificate->found_mm, again.max_mm());
  EXPECT_EQ(mesh.certificate->budget_mm->quantisation, 0);
}

TEST_F(ErrorJobsTest, TellTheStagesApart) {
  JobParameters parameters = parameters_of(volume_, 0);
  parameters.max_error_mm = 0.1;
  parameters.certify = true;
  std::vector<Stage> stages;
  const Report note = [&](Stage stage, double, const Timing&) {
    if (stages.empty() || stages.back() != stage) stages.push_back(stage);
  };
  const Timing timing = run(volume_, parameters, note).timing;
  EXPECT_THAT(stages,
              testing::ElementsAre(Stage::kLoad, Stage::kExtract, Stage::kSmooth, Stage::kSimplify,
                                   Stage::kEncode, Stage::kCertify, Stage::kEncode));
  EXPECT_GT(timing.simplify, 0);
  EXPECT_GT(timing.certify, 0);
}

TEST_F(ErrorJobsTest, FillCavitiesAndKeepPartsAtAPlace) {
  JobParameters parameters = parameters_of(volume_, 0);
  const MeshSummary all = run(parameters);
  ASSERT_EQ(all.components, 3U);
  parameters.fill_cavities = true;
  const MeshSummary solid = run(parameters);
  EXPECT_EQ(solid.components, 2U);
  EXPECT_EQ(solid.dropped.components, 1U);
  EXPECT_GT(solid.volume_mm3.smoothed, all.volume_mm3.smoothed + 200);
  parameters.components.nearest_to = {{22, 10, 10}};
  const MeshSummary speck = run(parameters);
  EXPECT_EQ(speck.components, 1U);
  EXPECT_EQ(speck.dropped.components, 2U);
  EXPECT_GT(speck.bounds[0][0], 18);
}

TEST_F(ErrorJobsTest, CropToABoxWithCapsInIt) {
  JobParameters parameters = parameters_of(volume_, 0);
  const Box box = {{{4.9, -5, 3}, {14.2, 100, 10}}};
  parameters.crop = box;
  parameters.close = true;
  const MeshSummary mesh = run(parameters);
  EXPECT_TRUE(mesh.quality.closed);
  // On the last samples in the box.
  EXPECT_NEAR(mesh.bounds[0][0], 5, 1e-5);
  EXPECT_NEAR(mesh.bounds[1][0], 14, 1e-5);
  EXPECT_NEAR(mesh.bounds[0][2], 3, 1e-5);
  EXPECT_NEAR(mesh.bounds[1][2], 10, 1e-5);
}

// Files in another space, and of the formats for programs that have it, are held against the
// surface where they lie.
TEST_F(ErrorJobsTest, MeasureFilesInTheSpaceThatTheyAreIn) {
  JobParameters parameters = parameters_of(volume_, 0);
  parameters.formats = {MeshFormat::kDrc, MeshFormat::kStl, MeshFormat::kOff,
                        MeshFormat::kVtk, MeshFormat::kVtp, MeshFormat::kGii,
                        MeshFormat::kGlb, MeshFormat::k3mf, MeshFormat::kUsdz};
  parameters.glb_codec = GlbCodec::kMeshopt;
  parameters.max_error_mm = 0.2;
  parameters.certify = true;
  for (const Space space : {Space::kLps, Space::kRas}) {
    parameters.space = space;
    const MeshSummary mesh = run(parameters);
    ASSERT_TRUE(mesh.certificate);
    EXPECT_LE(mesh.certificate->found_mm, 0.2);
    EXPECT_EQ(mesh.files.size(), parameters.formats.size());
  }
}

TEST_F(ErrorJobsTest, SayThatThereIsNoSurface) {
  JobParameters parameters = parameters_of(volume_, 1000);
  parameters.formats = {MeshFormat::kDrc,  MeshFormat::kStl, MeshFormat::kGlb, MeshFormat::k3mf,
                        MeshFormat::kOff,  MeshFormat::kVtk, MeshFormat::kVtp, MeshFormat::kGii,
                        MeshFormat::kUsda, MeshFormat::kUsdz};
  EXPECT_TRUE(run(parameters).empty);
  parameters.max_error_mm = 0.1;
  parameters.certify = true;
  const MeshSummary mesh = run(parameters);
  EXPECT_TRUE(mesh.empty);
  EXPECT_EQ(mesh.iso, 1000);
  EXPECT_EQ(mesh.certificate->found_mm, 0);
  EXPECT_EQ(mesh.certificate->from_mesh.points, 0U);
}

TEST_F(ErrorJobsTest, OfLabelsAreWithinTheErrorInEveryFile) {
  const Volume labels = add(test::sample<std::uint8_t>(
                                [](const test::Point& p) {
                                  return p[0] < 9 ? (p[1] < 8 ? 1.0 : 2.0) : (p[2] < 7 ? 3.0 : 0);
                                },
                                {20, 20, 20}),
                            SampleType::kUint8);
  JobParameters parameters = label_parameters({});
  parameters.volume = labels.id;
  parameters.close = true;
  parameters.formats = {MeshFormat::kGlb, MeshFormat::kStl, MeshFormat::k3mf, MeshFormat::kVtk,
                        MeshFormat::kVtp, MeshFormat::kOff, MeshFormat::kGii};
  parameters.space = Space::kRas;
  parameters.max_error_mm = 0.2;
  parameters.certify = true;
  const MeshSummary mesh = run(labels, parameters).mesh;
  EXPECT_LE(mesh.certificate->found_mm, 0.2);
  EXPECT_GT(mesh.certificate->found_mm, 0);
  EXPECT_LT(mesh.triangles, mesh.simplified->triangles_before / 2);
  ASSERT_EQ(mesh.labels.size(), 3U);
  for (const LabelSummary& label : mesh.labels) {
    EXPECT_TRUE(label.closed && label.manifold && label.oriented) << label.label;
  }
}

// Each label's Draco stream lies in the ZIP, of which all together are one file to be measured.
TEST_F(ErrorJobsTest, OfLabelsMeasureDracoInTheZip) {
  const Volume labels =
      add(test::sample<std::uint8_t>([](const test::Point& p) { return p[0] < 6 ? 1.0 : 2.0; },
                                     {12, 12, 12}),
          SampleType::kUint8);
  JobParameters parameters = label_parameters({});
  parameters.volume = labels.id;
  parameters.close = true;
  parameters.formats = {MeshFormat::kDrc};
  parameters.passes = 0;
  parameters.draco.position_bits = 8;  // so that it is far
  parameters.certify = true;
  const auto certified = [&] { return *run(labels, parameters).mesh.certificate; };
  const MeshCertificate rounded = certified();
  EXPECT_EQ(rounded.file, MeshFormat::kDrc);
  parameters.formats = {MeshFormat::kStl, MeshFormat::kDrc};
  EXPECT_EQ(certified(), rounded);
  parameters.formats = {MeshFormat::kStl, MeshFormat::kPly};
  const MeshCertificate exact = certified();
  EXPECT_EQ(exact.file, MeshFormat::kPly);  // the files of all labels come first
  EXPECT_LT(exact.found_mm, rounded.found_mm);
}

TEST_F(ErrorJobsTest, OfAGlbWithoutACodecAreThoseOfTheMesh) {
  JobParameters parameters = parameters_of(volume_, 0);
  parameters.draco.position_bits = 8;  // so that rounding shows
  parameters.certify = true;
  const auto certified = [&](MeshFormat format, GlbCodec codec) {
    parameters.formats = {format};
    parameters.glb_codec = codec;
    return *run(parameters).certificate;
  };
  const MeshCertificate exact = certified(MeshFormat::kStl, GlbCodec::kDraco);
  const MeshCertificate plain = certified(MeshFormat::kGlb, GlbCodec::kNone);
  EXPECT_EQ(plain.file, MeshFormat::kGlb);
  EXPECT_EQ(plain.found_mm, exact.found_mm);
  for (const GlbCodec codec : {GlbCodec::kDraco, GlbCodec::kKhrMeshopt, GlbCodec::kQuantized}) {
    EXPECT_GT(certified(MeshFormat::kGlb, codec).found_mm, exact.found_mm) << to_string(codec);
  }
}

TEST_F(ErrorJobsTest, AreCancelledAndRefusedAsOthersAre) {
  JobParameters parameters = parameters_of(volume_, 0);
  parameters.max_error_mm = 0.1;
  parameters.certify = true;
  parameters.min_thickness_mm = 0.4;
  for (const Stage at : {Stage::kSimplify, Stage::kCertify, Stage::kThickness}) {
    std::stop_source stop;
    const Report stop_there = [&](Stage stage, double, const Timing&) {
      if (stage == at) stop.request_stop();
    };
    EXPECT_EQ(test::code_thrown_by([&] { run(volume_, parameters, stop_there, stop.get_token()); }),
              ErrorCode::kCancelled);
  }
  const PipelineLimits few = {.memory_bytes = 3'000'000};
  EXPECT_EQ(test::code_thrown_by(
                [&] { run_pipeline(volume_, parameters, few, blobs_, process_, {}, kQuiet); }),
            ErrorCode::kTooLarge);
}

}  // namespace
}  // namespace isomesh::jobs
