#include "tests/unit/mesh/reference_surface.h"

namespace isomesh::mesh {

std::vector<ExtractOptions> all_options(double iso, bool close) {
  return {{iso, Scheme::kFive, Interpolation::kLinear, close},
          {iso, Scheme::kSix, Interpolation::kLinear, close},
          {iso, Scheme::kFive, Interpolation::kMidpoint, close},
          {iso, Scheme::kSix, Interpolation::kMidpoint, close}};
}

ExtractOptions regularized(ExtractOptions options) {
  options.regularize = true;
  return options;
}

std::string describe(const Dims& dims, const ExtractOptions& options) {
  std::ostringstream text;
  text << dims.x << "x" << dims.y << "x" << dims.z << ", iso " << options.iso << ", scheme "
       << static_cast<int>(options.scheme) << ", " << to_string(options.interpolation)
       << (options.close ? ", closed" : "") << (options.inside == Inside::kBelow ? ", below" : "");
  return text.str();
}

void expect_extent(const test::Surface& surface, const test::ScalarSurface& reference,
                   const ExtractOptions& options) {
  const test::ExtentFacts expected =
      test::extent_of(reference.surface(), reference.to_space.origin);
  const test::ExtentFacts facts = test::extent_of(surface, reference.to_space.origin);
  double longest_edge = 0;
  double farthest = 0;
  for (std::size_t axis = 0; axis < 3; ++axis) {
    const LatticeToSpace& map = reference.to_space;
    longest_edge +=
        std::abs(map.step_x[axis]) + std::abs(map.step_y[axis]) + std::abs(map.step_z[axis]);
    farthest += std::max(std::abs(expected.low[axis]), std::abs(expected.high[axis]));
  }
  const double margin =
      options.interpolation == Interpolation::kLinear ? test::kEndMargin * longest_edge : 0;
  const double moved = margin + 1e-6 * (longest_edge + farthest);
  const double area_change =
      moved * (expected.perimeter + moved * static_cast<double>(surface.triangles.size()));
  EXPECT_NEAR(facts.area, expected.area, area_change);
  // The cones from the border's edges to the apex count as well as the surface.
  EXPECT_NEAR(facts.volume, expected.volume, moved * expected.area + farthest * area_change);
}

}  // namespace isomesh::mesh
