// Files of jobs hold what isomesh-verify checks.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "tests/unit/verify/made.h"

namespace isomesh::test {
namespace {

using testing::HasSubstr;

void expect_right(const SampleVolume<float>& volume, const MeshParameters& parameters) {
  const verify::Surface mesh = verify::read_surface(made(volume, parameters));
  ASSERT_GT(mesh.triangles.size(), 100U);
  const verify::Verdict said = verdict(mesh, volume, parameters);
  EXPECT_TRUE(said.holds) << said.text;
  EXPECT_THAT(said.text, HasSubstr("PASSED: every point is within"));
}

// An open surface of many handles in a volume of any geometry.
SampleVolume<float> open_volume(const Geometry& geometry) {
  auto volume = sample<float>(scaled(gyroid(9), 100, 7), {19, 16, 14}, Geometry{});
  volume.geometry = geometry;
  return volume;
}

TEST(Verify, AcceptsJobsOfBothSchemesOpenAndClosed) {
  for (const SchemeName scheme : {SchemeName::kFive, SchemeName::kSix}) {
    for (const bool close : {false, true}) {
      for (const Geometry& geometry : {Geometry{}, oblique_left_handed_geometry()}) {
        MeshParameters parameters = parameters_within(0.1);
        parameters.scheme = scheme;
        parameters.close = close;
        expect_right(open_volume(geometry), parameters);
      }
    }
  }
}

TEST(Verify, AcceptsJobsWithOtherParameters) {
  const auto with = [](auto change) {
    MeshParameters parameters = parameters_within(0.08);
    change(parameters);
    expect_right(balls(), parameters);
  };
  with([](MeshParameters& p) { p.passes = 5; });
  with([](MeshParameters& p) { p.interpolation = Interpolation::kMidpoint; });
  const auto extracted_with = [&](auto change) {
    with([&](MeshParameters& p) {
      p.max_error_mm.reset();  // which is not proven here
      p.regularize = false;
      change(p);
    });
  };
  extracted_with([](MeshParameters& p) { p.fill_cavities = true; });
  extracted_with([](MeshParameters& p) { p.components.keep = 1; });
  with([](MeshParameters& p) {
    p.crop = Box{{{2.4, -5, 1.5}, {7.1, 100, 5}}};
    p.close = true;
  });
  for (const MeshFormat format : {MeshFormat::kPly, MeshFormat::kGlb, MeshFormat::kStl}) {
    for (const Space space : {Space::kLps, Space::kRas}) {
      with([&](MeshParameters& p) {
        p.formats = {format};
        p.space = space;
      });
    }
  }
}

TEST(Verify, AcceptsJobsAroundDarkStructures) {
  for (const bool close : {false, true}) {
    for (const Interpolation interpolation : {Interpolation::kLinear, Interpolation::kMidpoint}) {
      MeshParameters parameters = parameters_within(0.1);
      parameters.inside = Inside::kBelow;
      parameters.close = close;
      parameters.interpolation = interpolation;
      expect_right(open_volume({}), parameters);
      expect_right(noise<float>({-1, 0, 1}, {12, 11, 10}, 3), parameters);
    }
  }
}

TEST(Verify, RejectsTheOtherSideOfASurface) {
  MeshParameters parameters = parameters_within(0.1);
  const verify::Surface mesh = verify::read_surface(made(balls(), parameters));
  parameters.inside = Inside::kBelow;
  const verify::Verdict said = verdict(mesh, balls(), parameters);
  EXPECT_FALSE(said.holds);
  EXPECT_THAT(said.text, HasSubstr("Components inside out: 3"));
}

// Samples that equal the iso-value are on the surface.
TEST(Verify, AcceptsJobsOfSamplesAtTheIsoValue) {
  const SampleVolume<float> volume = noise<float>({-1, 0, 1}, {12, 11, 10}, 3);
  for (const bool close : {false, true}) {
    MeshParameters parameters = parameters_within(0.1);
    parameters.close = close;
    expect_right(volume, parameters);
  }
}

// Samples at the iso-value make walls without thickness: both of their sides are near.
TEST(Verify, AcceptsJobsOfThinWalls) {
  MeshParameters parameters = parameters_within(0.1);
  expect_right(noise<float>({-1, 0, 1}, {9, 9, 7}, 3192), parameters);
  parameters.scheme = SchemeName::kFive;
  expect_right(noise<float>({-1, 0, 1}, {7, 7, 5}, 1768), parameters);
}

// Corners of caps are at samples.
TEST(Verify, AcceptsCapsOfSmallCavities) {
  MeshParameters parameters = parameters_within(0.05);
  parameters.close = true;
  parameters.scheme = SchemeName::kFive;
  expect_right(noise_between<float>(-1, 1.5, {2, 6, 9}, 13263), parameters);
}

TEST(Verify, RejectsTheSurfaceOfAnotherField) {
  MeshParameters parameters = parameters_within(0.05);
  const verify::Surface mesh = verify::read_surface(made(balls(), parameters));
  parameters.iso = 0.2;
  EXPECT_FALSE(verdict(mesh, balls(), parameters).holds);
  parameters.iso = 0;
  parameters.max_error_mm = 0.02;
  EXPECT_FALSE(verdict(mesh, balls(), parameters).holds);
}

TEST(Verify, SaysWhenThereIsNothing) {
  MeshParameters parameters = parameters_within(0.05);
  EXPECT_FALSE(verdict({}, balls(), parameters).holds);
  parameters.components.keep = 1;
  EXPECT_FALSE(verdict({}, balls(), parameters).holds);
  parameters.iso = 1000;
  EXPECT_TRUE(verdict({}, balls(), parameters).holds);
}

}  // namespace
}  // namespace isomesh::test
