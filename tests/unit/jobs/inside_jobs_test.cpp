// Jobs around dark structures, and surfaces that are inside out.
#include <algorithm>
#include <cmath>
#include <numbers>

#include <gtest/gtest.h>

#include "tests/unit/jobs/fixture.h"

namespace isomesh::jobs {
namespace {

constexpr double kRadius = 8;
constexpr double kBall = 4.0 / 3 * std::numbers::pi * kRadius * kRadius * kRadius;

// Negative within a ball, positive around it.
test::SampleVolume<float> dark_ball(const test::Point& centre) {
  return test::sample<float>(test::scaled(test::sphere(centre, kRadius), -1, 0), {24, 24, 24});
}

class InsideJobs : public test::PipelineFixture {
 protected:
  static JobParameters below(const Volume& volume) {
    JobParameters parameters = parameters_of(volume, 0);
    parameters.inside = Inside::kBelow;
    parameters.passes = 0;
    return parameters;
  }
};

TEST_F(InsideJobs, EncloseADarkBall) {
  const Volume volume = add(dark_ball({11.5, 11.5, 11.5}), SampleType::kFloat32);
  JobParameters parameters = below(volume);
  const MeshSummary dark = run(volume, parameters).mesh;
  EXPECT_TRUE(dark.quality.encloses_volume);
  EXPECT_NEAR(dark.volume_mm3.smoothed, kBall, 0.02 * kBall);
  parameters.inside = Inside::kAbove;
  const MeshSummary bright = run(volume, parameters).mesh;
  EXPECT_TRUE(bright.quality.closed);
  EXPECT_TRUE(bright.quality.oriented);
  EXPECT_FALSE(bright.quality.encloses_volume) << "its inside is around the ball";
  EXPECT_EQ(bright.volume_mm3.smoothed, -dark.volume_mm3.smoothed);
  EXPECT_EQ(bright.area_mm2, dark.area_mm2);
}

TEST_F(InsideJobs, CloseSmoothProveAndCertify) {
  const Volume volume = add(dark_ball({11.5, 11.5, 3}), SampleType::kFloat32);
  JobParameters parameters = below(volume);
  parameters.passes = 5;
  parameters.smoothing = Smoothing::kTaubin;
  parameters.close = true;
  parameters.max_error_mm = 0.4;
  parameters.certify = true;
  // A cap takes the ball beyond 3 mm below its centre.
  constexpr double kCap = std::numbers::pi * (kRadius - 3) * (kRadius - 3) * (2 * kRadius + 3) / 3;
  for (const SchemeName scheme : {SchemeName::kFive, SchemeName::kSix, SchemeName::kBcc}) {
    parameters.scheme = scheme;
    const MeshSummary mesh = run(volume, parameters).mesh;
    EXPECT_TRUE(mesh.quality.encloses_volume);
    EXPECT_NEAR(mesh.volume_mm3.smoothed, kBall - kCap, 0.06 * kBall);
    ASSERT_TRUE(mesh.certificate);
    EXPECT_TRUE(mesh.certificate->bound_mm) << mesh.certificate->why_unproven.value_or("");
    EXPECT_LE(mesh.certificate->found_mm, 0.4);
  }
}

// Dark: a shell with a bright ball in it, and a small ball beside it.
TEST_F(InsideJobs, ChooseComponentsAndFillCavities) {
  const test::Point centre = {11.5, 11.5, 11.5};
  const auto field = [&](const test::Point& p) {
    const double shell = std::min(test::sphere(centre, kRadius)(p), -test::sphere(centre, 4)(p));
    return -std::max(shell, test::sphere({26, 11.5, 11.5}, 3)(p));
  };
  const Volume volume = add(test::sample<float>(field, {32, 24, 24}), SampleType::kFloat32);
  JobParameters parameters = below(volume);
  EXPECT_EQ(run(volume, parameters).mesh.components, 3U);
  parameters.components.keep = 1;
  parameters.fill_cavities = true;
  const MeshSummary mesh = run(volume, parameters).mesh;
  EXPECT_EQ(mesh.components, 1U);
  EXPECT_EQ(mesh.dropped.components, 2U);
  EXPECT_NEAR(mesh.volume_mm3.smoothed, kBall, 0.02 * kBall);
}

// It fills the volume, but for a ball.
TEST_F(InsideJobs, GiveALabelAroundACavityNoVolume) {
  auto samples = test::constant<std::uint8_t>(1, {9, 9, 9});
  samples.at(4, 4, 4) = 0;
  const Volume volume = add(samples, SampleType::kUint8);
  JobParameters parameters = label_parameters({{1}});
  parameters.volume = volume.id;
  const MeshSummary mesh = run(volume, parameters).mesh;
  ASSERT_EQ(mesh.labels.size(), 1U);
  EXPECT_TRUE(mesh.labels[0].closed);
  EXPECT_LT(mesh.labels[0].volume_mm3, 0);
  EXPECT_FALSE(mesh.labels[0].encloses_volume());
  EXPECT_FALSE(mesh.quality.encloses_volume);
}

}  // namespace
}  // namespace isomesh::jobs
