#include <algorithm>
#include <tuple>

#include <gtest/gtest.h>

#include "server/mesh/extract/extract.h"
#include "tests/unit/mesh/reference_surface.h"

namespace isomesh::mesh {
namespace {

using test::SampleVolume;

// ---- Single cells

using CellCase = std::tuple<test::Parity, test::Surround>;
class SignPatterns : public testing::TestWithParam<CellCase> {};

TEST_P(SignPatterns, AreTheReferencesSurface) {
  const auto& [parity, surround] = GetParam();
  for (unsigned pattern = 0; pattern < 256 && !HasFailure(); ++pattern) {
    SCOPED_TRACE(pattern);
    expect_reference_surfaces(test::sign_pattern<std::uint8_t>(pattern, parity, surround),
                              test::kPatternIso);
  }
}

// The same in a cell whose neighbours in x belong to another word of 64 samples.
TEST_P(SignPatterns, AreTheReferencesSurfaceAcrossWords) {
  const auto& [parity, surround] = GetParam();
  for (unsigned pattern = 0; pattern < 256 && !HasFailure(); ++pattern) {
    SCOPED_TRACE(pattern);
    const auto cell = test::sign_pattern<float>(pattern, parity, surround);
    auto wide = test::constant<float>(cell.samples[0], {63 + cell.dims.x, 4, 4});
    for (std::uint32_t row = 0; row < 16; ++row) {
      // An even number of samples, so that the cell's parity stays.
      const std::uint32_t shift = cell.dims.x == 5 ? 60 : 62;
      std::copy_n(cell.samples.begin() + row * cell.dims.x, cell.dims.x,
                  wide.samples.begin() + row * wide.dims.x + shift);
    }
    for (const Scheme scheme : {Scheme::kFive, Scheme::kSix}) {
      expect_reference_surface(wide, {test::kPatternIso, scheme, Interpolation::kLinear});
    }
  }
}

INSTANTIATE_TEST_SUITE_P(Cells, SignPatterns,
                         testing::Combine(testing::Values(test::Parity::kEven, test::Parity::kOdd),
                                          testing::Values(test::Surround::kOutside,
                                                          test::Surround::kInside)));

TEST(SignPattern, OfOneCellAloneIsTheReferencesSurface) {
  for (unsigned pattern = 0; pattern < 256 && !testing::Test::HasFailure(); ++pattern) {
    SCOPED_TRACE(pattern);
    SampleVolume<std::int16_t> volume = test::constant<std::int16_t>(-3, {2, 2, 2});
    for (unsigned corner = 0; corner < 8; ++corner) {
      if ((pattern >> corner & 1U) != 0) volume.samples[corner] = 5;
    }
    expect_reference_surfaces(volume, 0);
  }
}

}  // namespace
}  // namespace isomesh::mesh
