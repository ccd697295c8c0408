// The program: its exit statuses and what it prints.
#include <string>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "tests/support/files.h"
#include "tests/support/process.h"
#include "tests/unit/verify/made.h"

namespace isomesh::test {
namespace {

using testing::HasSubstr;

class VerifyCommand : public testing::Test {
 protected:
  void SetUp() override {
    write_file(volume_,
               "NRRD0004\ntype: float\ndimension: 3\nspace: left-posterior-superior\n"
               "sizes: 28 21 21\nspace directions: (0.5,0,0) (0,0.5,0) (0,0,0.5)\n"
               "space origin: (0,0,0)\nendian: little\nencoding: raw\n\n" +
                   bytes_of(balls().samples));
    write_file(mesh_, made(balls(), parameters_within(0.1)));
  }

  Finished verified(const std::vector<std::string>& more) const {
    return run(with({ISOMESH_VERIFY, mesh_, "--volume", volume_, "--iso", "0"}, more));
  }

  const TemporaryFolder folder_;
  const std::string mesh_ = folder_ / "mesh.stl";
  const std::string volume_ = folder_ / "volume.nrrd";
};

TEST_F(VerifyCommand, SaysThatAMeshIsWithinTheBound) {
  const Finished end = verified({"--bound", "0.1"});
  EXPECT_EQ(end.status, 0) << end.errors;
  EXPECT_THAT(end.output, HasSubstr("PASSED: every point is within 0.1 mm, both ways"));
}

TEST_F(VerifyCommand, SaysWhereAMeshIsNot) {
  const Finished end = verified({"--bound", "0.01"});
  EXPECT_EQ(end.status, 1) << end.errors;
  EXPECT_THAT(end.output, HasSubstr(" mm at ("));
  EXPECT_THAT(end.output, HasSubstr("FAILED"));
  EXPECT_EQ(verified({"--bound", "0.1", "--close", "--crop=0,0,0,5,5,5"}).status, 1);
}

TEST_F(VerifyCommand, AsksForTheComponentsThatTheJobKept) {
  MeshParameters parameters = parameters_within(0.1);
  parameters.components.keep = 1;
  write_file(mesh_, made(balls(), parameters));
  const Finished without = verified({"--bound", "0.1"});
  EXPECT_EQ(without.status, 1);
  EXPECT_THAT(without.output, HasSubstr(", in the surface's component 3 of 3, of "));
  EXPECT_EQ(verified({"--bound", "0.1", "--keep-components", "1"}).status, 0);
  EXPECT_EQ(verified({"--bound", "0.1", "--keep-components", "2"}).status, 1);
  EXPECT_EQ(verified({"--bound", "0.1", "--keep-nearest-to", "2,2,0.5"}).status, 0);
  EXPECT_EQ(verified({"--bound", "0.1", "--keep-nearest-to=11,5,5"}).status, 1);
  EXPECT_EQ(verified({"--bound", "0.1", "--min-component-triangles", "3"}).status, 1);
  EXPECT_EQ(verified({"--bound", "0.1", "--keep-components", "0"}).status, 2);
  EXPECT_EQ(verified({"--bound", "0.1", "--keep-nearest-to", "5,x,2"}).status, 2);
}

// GLB files carry the parameters of their job; options replace them.
TEST_F(VerifyCommand, TakesTheParametersThatAFileCarries) {
  MeshParameters parameters = parameters_within(0.1);
  parameters.iso = 0.25;
  parameters.formats = {MeshFormat::kGlb};
  parameters.scheme = SchemeName::kFive;
  parameters.components.keep = 1;
  parameters.fill_cavities = true;
  parameters.crop = Box{{{2.4, -5, 1.5}, {7.1, 100, 5}}};
  parameters.close = true;
  const std::string mesh = folder_ / "mesh.glb";
  write_file(mesh, made(balls(), parameters));
  const auto status_with = [&](const std::vector<std::string>& more) {
    return run(with({ISOMESH_VERIFY, mesh, "--volume", volume_}, more)).status;
  };
  EXPECT_EQ(status_with({}), 0);
  EXPECT_EQ(status_with({"--bound", "0.001"}), 1);
  EXPECT_EQ(status_with({"--iso", "0.5"}), 1);
  EXPECT_EQ(status_with({"--keep-components", "2"}), 0);  // filled and cropped, there is one
  EXPECT_EQ(status_with({"--crop", "0,0,0,9,9,9"}), 1);
  parameters.scheme = SchemeName::kBcc;
  write_file(mesh, made(balls(), parameters));
  EXPECT_EQ(status_with({}), 2);
}

TEST_F(VerifyCommand, SwitchesOffWhatAFileSwitchesOn) {
  MeshParameters parameters = parameters_within(0.1);
  parameters.max_error_mm.reset();
  parameters.iso = -1.5;  // so low that the balls touch the border
  parameters.regularize = false;
  parameters.formats = {MeshFormat::kGlb};
  parameters.interpolation = Interpolation::kMidpoint;
  parameters.close = parameters.fill_cavities = true;
  const std::string mesh = folder_ / "mesh.glb";
  write_file(mesh, made(balls(), parameters));
  const auto status_with = [&](const std::vector<std::string>& more) {
    return run(with({ISOMESH_VERIFY, mesh, "--volume", volume_, "--bound", "0.01"}, more)).status;
  };
  EXPECT_EQ(status_with({}), 0);
  EXPECT_EQ(status_with({"--close", "--midpoint", "--fill-cavities"}), 0);
  for (const char* off : {"--no-close", "--no-midpoint", "--no-fill-cavities"}) {
    EXPECT_EQ(status_with({off}), 1) << off;
  }
}

TEST_F(VerifyCommand, EndsWithStatusTwoWhereItCannotTell) {
  const auto expect_refused = [&](const std::vector<std::string>& more, const char* text) {
    const Finished end = verified(more);
    EXPECT_EQ(end.status, 2);
    EXPECT_THAT(end.errors, HasSubstr(text));
    EXPECT_EQ(end.output, "");
  };
  expect_refused({}, "--bound is required");
  expect_refused({"--bound", "0"}, "must be positive");
  expect_refused({"--bound", "nan"}, "must be positive");
  expect_refused({"--bound", "1", "--scheme", "7"}, "--scheme");
  expect_refused({"--bound", "1", "--crop", "90,0,0,91,1,1"}, "the box has no samples");
  expect_refused({"--bound", "1", "--crop", "1,2,3"}, "--crop");
  write_file(mesh_, read_file(mesh_).substr(0, 1000));
  expect_refused({"--bound", "1"}, "the mesh cannot be read: it has 1000 bytes");
  write_file(mesh_, made(balls(), parameters_within(0.1)));
  write_file(volume_, "NRRD0004\n");
  expect_refused({"--bound", "1"}, "isomesh-verify: ");
  const Finished absent = run(
      {ISOMESH_VERIFY, folder_ / "absent.stl", "--volume", volume_, "--iso", "0", "--bound", "1"});
  EXPECT_EQ(absent.status, 2);
  EXPECT_THAT(absent.errors, HasSubstr("absent.stl"));
}

TEST_F(VerifyCommand, DescribesItself) {
  const Finished help = run({ISOMESH_VERIFY, "--help"});
  EXPECT_EQ(help.status, 0);
  EXPECT_THAT(help.output, HasSubstr("Exit status: 0"));
  EXPECT_THAT(run({ISOMESH_VERIFY, "manual"}).output, HasSubstr(".TH"));
}

}  // namespace
}  // namespace isomesh::test
