// Jobs on a flat cylinder, from stored samples: the note on what smoothing takes.
#include <algorithm>
#include <cmath>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "proto/notes.h"
#include "tests/unit/jobs/fixture.h"

namespace isomesh::jobs {
namespace {

using testing::AllOf;
using testing::ElementsAre;
using testing::Field;
using testing::HasSubstr;
using testing::IsEmpty;
using testing::Not;

constexpr mesh::Dims kCylinderDims = {51, 51, 15};

// The signed distance from a cylinder that is 40 voxels wide and 4 thick, positive inside.
double flat_cylinder(const test::Point& point) {
  const auto& [x, y, z] = point;
  const double across = std::hypot(x - 25.3, y - 25.2) - 20;
  const double along = std::abs(z - 7.4) - 2;
  return -(std::min(std::max(across, along), 0.0) +
           std::hypot(std::max(across, 0.0), std::max(along, 0.0)));
}

class ChangedVolumeTest : public test::PipelineFixture {
 protected:
  MeshSummary made(const JobParameters& parameters) { return run(volume_, parameters).mesh; }

  const Volume volume_ =
      add(test::sample<float>(flat_cylinder, kCylinderDims), SampleType::kFloat32);
  JobParameters parameters_ = parameters_of(volume_, 0);
};

auto tells(const std::string& text) {
  return AllOf(Field(&Note::code, describe(NoteCode::kVolumeChanged).name),
               Field(&Note::detail, HasSubstr(text)));
}

TEST_F(ChangedVolumeTest, IsToldWithItsWaysOut) {
  const MeshSummary mesh = made(parameters_);
  EXPECT_NEAR(mesh.volume_mm3.smoothed / mesh.volume_mm3.extracted, 0.912, 0.001);
  EXPECT_NEAR(mesh.area_mm2 / mesh.area_extracted_mm2, 0.911, 0.001);
  EXPECT_THAT(mesh.notes, ElementsAre(tells(
                              "Smoothing made the volume 8.8 % smaller and the area 8.9 % smaller. "
                              "smoothing=taubin keeps the volume; "
                              "regularize=false changes less of it.")));
  parameters_.smoothing = Smoothing::kTaubin;
  EXPECT_THAT(made(parameters_).notes, IsEmpty());
}

TEST_F(ChangedVolumeTest, NamesNoWayOutThatIsTaken) {
  parameters_.regularize = false;
  parameters_.passes = 20;
  const MeshSummary plain = made(parameters_);
  EXPECT_THAT(plain.notes, ElementsAre(tells("smoothing=taubin keeps the volume.")));
  EXPECT_THAT(plain.notes, ElementsAre(Field(&Note::detail, Not(HasSubstr("regularize")))));
  parameters_.passes = 0;
  EXPECT_THAT(made(parameters_).notes, IsEmpty());
}

// Simplification changes the volume, too, which is bounded otherwise.
TEST_F(ChangedVolumeTest, IsThatOfSmoothingAlone) {
  parameters_.passes = 0;
  parameters_.max_error_mm = 1;
  const MeshSummary coarse = made(parameters_);
  EXPECT_GT(std::abs(coarse.volume_mm3.smoothed / coarse.volume_mm3.extracted - 1), 0.01);
  EXPECT_THAT(coarse.notes, IsEmpty());
}

// The cylinder is cut open, and encloses nothing.
TEST_F(ChangedVolumeTest, IsNotToldIfThereIsNone) {
  parameters_.crop = Box{{{0, 0, 0}, {25, 50, 14}}};
  const MeshSummary open = made(parameters_);
  EXPECT_FALSE(open.quality.closed);
  EXPECT_THAT(open.notes, IsEmpty());
  parameters_.close = true;
  EXPECT_THAT(made(parameters_).notes, ElementsAre(tells("Smoothing made the volume ")));
}

}  // namespace
}  // namespace isomesh::jobs
