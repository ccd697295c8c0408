// Jobs on hollow balls, from stored samples: the note on cavities that thin walls leave open.
#include <cmath>
#include <cstdint>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "proto/notes.h"
#include "tests/unit/jobs/fixture.h"

namespace isomesh::jobs {
namespace {

using testing::ElementsAre;
using testing::Field;
using testing::HasSubstr;
using testing::IsEmpty;

struct Ball {
  double x;                // of its centre; y and z are 15.3 and 15.8
  double wall;             // in voxels, around a radius of 12
  std::uint8_t value = 1;  // of the wall
  std::uint8_t within = 0;
};

class ThinWallsTest : public test::PipelineFixture {
 protected:
  test::SampleVolume<std::uint8_t> balls(const std::vector<Ball>& balls) {
    auto samples = test::constant<std::uint8_t>(0, {96, 32, 32});
    for (std::uint32_t k = 0; k < samples.dims.z; ++k) {
      for (std::uint32_t j = 0; j < samples.dims.y; ++j) {
        for (std::uint32_t i = 0; i < samples.dims.x; ++i) {
          for (const Ball& ball : balls) {
            const double r = std::hypot(i - ball.x, j - 15.3, k - 15.8) - 12;
            if (std::abs(r) <= ball.wall / 2)
              samples.at(i, j, k) = ball.value;
            else if (r < 0)
              samples.at(i, j, k) = ball.within;
          }
        }
      }
    }
    return samples;
  }

  Volume add_balls(const std::vector<Ball>& all) { return add(balls(all), SampleType::kUint8); }

  MeshSummary made(const Volume& volume, JobParameters parameters, SchemeName scheme) {
    parameters.volume = volume.id;
    parameters.scheme = scheme;
    parameters.close = true;
    parameters.passes = 0;  // smoothing thin walls has a note of its own
    return run(volume, parameters).mesh;
  }
};

constexpr Ball kThin = {.x = 15.6, .wall = 1.5};
constexpr Ball kThick = {.x = 47.6, .wall = 1.75};

auto says(const std::string& text) {
  return testing::AllOf(Field(&Note::code, describe(NoteCode::kThinWalls).name),
                        Field(&Note::detail, HasSubstr(text)));
}

TEST_F(ThinWallsTest, OfAMaskAreTold) {
  const Volume volume = add_balls({kThin, kThick});
  const JobParameters parameters = parameters_of(volume, 0.5);
  const MeshSummary six = made(volume, parameters, SchemeName::kSix);
  EXPECT_EQ(six.components, 3U);
  EXPECT_THAT(six.notes, ElementsAre(says("1 cavity of ")));
  EXPECT_THAT(six.notes, ElementsAre(says("scheme=5 closes it.")));
  for (const SchemeName scheme : {SchemeName::kFive, SchemeName::kBcc}) {
    const MeshSummary closed = made(volume, parameters, scheme);
    EXPECT_EQ(closed.components, 4U);
    EXPECT_THAT(closed.notes, IsEmpty());
  }
  EXPECT_THAT(made(add_balls({kThick}), parameters, SchemeName::kSix).notes, IsEmpty());
}

TEST_F(ThinWallsTest, MayHaveNoSchemeThatClosesAllOfThem) {
  const Volume volume = add_balls({kThin, {.x = 47.6, .wall = 1}});
  const MeshSummary six = made(volume, parameters_of(volume, 0.5), SchemeName::kSix);
  EXPECT_THAT(six.notes, ElementsAre(says("2 cavities of ")));
  EXPECT_THAT(six.notes, ElementsAre(says("scheme=5 leaves 1 of them open.")));
  const MeshSummary five = made(volume, parameters_of(volume, 0.5), SchemeName::kFive);
  EXPECT_THAT(five.notes, ElementsAre(says("No other scheme closes more of them.")));
}

// Grey values are looked at only where cavities matter: noise has many.
TEST_F(ThinWallsTest, OfGreyValuesAreToldIfCavitiesAreToBeFilled) {
  const Volume volume = add_balls({kThin, {.x = 47.6, .wall = 3, .value = 2}});
  JobParameters parameters = parameters_of(volume, 0.5);
  EXPECT_THAT(made(volume, parameters, SchemeName::kSix).notes, IsEmpty());
  parameters.fill_cavities = true;
  const MeshSummary six = made(volume, parameters, SchemeName::kSix);
  EXPECT_EQ(six.dropped.components, 1U);
  EXPECT_THAT(six.notes, ElementsAre(says("open in the surface, and not filled.")));
  const MeshSummary five = made(volume, parameters, SchemeName::kFive);
  EXPECT_EQ(five.dropped.components, 2U);
  EXPECT_THAT(five.notes, IsEmpty());
  parameters.fill_cavities = false;
  parameters.components.keep = 1;
  EXPECT_EQ(made(volume, parameters, SchemeName::kSix).notes.size(), 1U);
}

// A dark shell in bright surroundings, with the samples below the iso-value inside.
TEST_F(ThinWallsTest, OfADarkMaskAreThoseOfTheBrightOne) {
  test::SampleVolume<std::uint8_t> samples = balls({kThin, kThick});
  const Volume bright = add(samples, SampleType::kUint8);
  for (std::uint8_t& sample : samples.samples) sample = 1 - sample;
  const Volume dark = add(samples, SampleType::kUint8);
  JobParameters below = parameters_of(dark, 0.5);
  below.inside = Inside::kBelow;
  const MeshSummary made_below = made(dark, below, SchemeName::kSix);
  EXPECT_THAT(made_below.notes, ElementsAre(says("1 cavity of ")));
  EXPECT_EQ(made_below.notes, made(bright, parameters_of(bright, 0.5), SchemeName::kSix).notes);
  EXPECT_THAT(made(dark, below, SchemeName::kFive).notes, IsEmpty());
}

// Each label by itself: what is within its wall may have another.
TEST_F(ThinWallsTest, OfLabelsAreTold) {
  const Volume volume = add_balls({{.x = 16.6, .wall = 1.5, .value = 5, .within = 3},
                                   {.x = 47.6, .wall = 1.75, .value = 9, .within = 3},
                                   {.x = 79.6, .wall = 1.5, .value = 9}});
  JobParameters parameters = label_parameters({});
  const MeshSummary six = made(volume, parameters, SchemeName::kSix);
  EXPECT_THAT(six.notes, ElementsAre(says("Label 5: 1 cavity of "), says("Label 9: 1 cavity of ")));
  EXPECT_THAT(made(volume, parameters, SchemeName::kFive).notes, IsEmpty());
  parameters.label_values[20] = {5, 3};
  const MeshSummary joined = made(volume, parameters, SchemeName::kSix);
  EXPECT_THAT(joined.notes, ElementsAre(says("Label 9: 1 cavity of ")));
}

// Labels at opposite corners have boxes as large as the volume.
TEST_F(ThinWallsTest, OfLabelsAreLookedForFromTheSmallestBoxUntilTimeIsSpent) {
  const std::vector<Ball> all = {{.x = 15.6, .wall = 1.5, .value = 9},
                                 {.x = 79.6, .wall = 1.5, .value = 10}};
  const auto with_large_labels = [&](std::uint8_t others) {
    auto samples = balls(all);
    const auto dims = samples.dims;
    const auto spread = [&](std::uint8_t value, std::uint32_t i, std::uint32_t j) {
      samples.at(i, j, 0) = value;
      samples.at(dims.x - 1 - i, dims.y - 1 - j, dims.z - 1) = value;
    };
    spread(9, 0, 0);
    for (std::uint8_t n = 1; n <= others; ++n) spread(n, n % 2, n / 2);
    const Volume volume = add(samples, SampleType::kUint8);
    return made(volume, label_parameters({}), SchemeName::kSix).notes;
  };
  EXPECT_THAT(with_large_labels(2),
              ElementsAre(says("Label 9: 1 cavity of "), says("Label 10: 1 cavity of ")));
  EXPECT_THAT(with_large_labels(3), ElementsAre(says("Label 10: 1 cavity of ")));
}

// A list may have values that no sample has, and that the type cannot have.
TEST_F(ThinWallsTest, OfALabelOfManyValuesAreTold) {
  const Volume volume = add_balls({{.x = 15.6, .wall = 1.5, .value = 9, .within = 4},
                                   {.x = 79.6, .wall = 1.5, .value = 7, .within = 4}});
  JobParameters parameters = label_parameters({});
  parameters.label_values[20] = {250, 9, 300, 7, -1, 8};
  const MeshSummary six = made(volume, parameters, SchemeName::kSix);
  EXPECT_THAT(six.notes, ElementsAre(says("Label 20: 2 cavities of ")));
}

}  // namespace
}  // namespace isomesh::jobs
