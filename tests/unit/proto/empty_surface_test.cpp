#include "proto/empty_surface.h"

#include <cstdint>
#include <optional>
#include <string>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "proto/error.h"

namespace isomesh {
namespace {

using testing::HasSubstr;
using testing::Not;

const SampleValues kValues = {{-1000, 3071}, 42.5};

std::string reason(const MeshParameters& parameters, std::optional<double> iso,
                   std::uint64_t dropped = 0) {
  MeshSummary mesh;
  mesh.iso = iso;
  mesh.dropped.components = dropped;
  return why_empty(parameters, mesh, kValues);
}

TEST(WhyEmpty, TellsTheRangeOfTheSamplesAndTheSuggestedIsoValue) {
  EXPECT_EQ(reason({}, 5000.25),
            "the iso-value 5000.25 separates none of the samples of the volume, which range from "
            "-1000 to 3071; its suggested iso-value is 42.5");
  MeshParameters cropped;
  cropped.crop.emplace();
  EXPECT_EQ(reason(cropped, 60),
            "the iso-value 60 separates none of the samples in the box of crop; those of the "
            "volume range from -1000 to 3071; its suggested iso-value is 42.5");
}

// Neither the value that was asked for, nor one that has no surface either.
TEST(WhyEmpty, SuggestsOnlyWhatMayHelp) {
  EXPECT_THAT(reason({}, 42.5), Not(HasSubstr("suggested")));
  MeshSummary mesh;
  mesh.iso = 9;
  for (const double suggested : {7.0, 8.0}) {
    EXPECT_EQ(why_empty({}, mesh, {{7, 7}, suggested}),
              "the iso-value 9 separates none of the samples of the volume, which range from 7 to "
              "7");
  }
}

TEST(WhyEmpty, TellsWhatLabelsAndDroppedComponentsLack) {
  MeshParameters closed;
  closed.close = true;
  EXPECT_EQ(reason({}, {}),
            "the chosen labels have no boundary; close adds the border of the volume to it");
  EXPECT_EQ(reason(closed, {}), "the chosen labels have no boundary");
  closed.crop.emplace();
  EXPECT_EQ(reason(closed, {}), "the chosen labels have no boundary in the box of crop");
  EXPECT_THAT(reason({}, 60, 1), HasSubstr("its only connected component was dropped"));
  EXPECT_THAT(reason({}, 60, 3), HasSubstr("all 3 connected components were dropped"));
}

TEST(EmptySurface, IsAnErrorWithTheReasonAndTheWayOut) {
  MeshSummary mesh;
  EXPECT_STREQ(empty_surface(mesh, "").what(), "the surface is empty");  // of an older server
  mesh.empty_reason = "so";
  const Error error = empty_surface(mesh, "--allow-empty accepts that");
  EXPECT_STREQ(error.what(), "the surface is empty: so; --allow-empty accepts that");
  EXPECT_EQ(describe(error.code()).name, "empty-surface");
}

}  // namespace
}  // namespace isomesh
