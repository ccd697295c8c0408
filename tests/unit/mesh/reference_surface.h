// That what the kernels extract is the scalar surface (tests/support/scalar_surface.h).
#pragma once

#include <algorithm>
#include <cmath>
#include <sstream>
#include <string>
#include <vector>

#include <gtest/gtest.h>

#include "server/mesh/extract/extract.h"
#include "server/mesh/extract/windows.h"
#include "tests/support/joined.h"
#include "tests/support/kernels.h"
#include "tests/support/mesh_checks.h"
#include "tests/support/scalar_surface.h"
#include "tests/support/shapes.h"

namespace isomesh::mesh {

// The four ways to extract at one iso-value.
std::vector<ExtractOptions> all_options(double iso, bool close = false);

std::string describe(const Dims& dims, const ExtractOptions& options);

// Area and volume as the reference has them, but for the small way that vertices may be moved.
void expect_extent(const test::Surface& surface, const test::ScalarSurface& reference,
                   const ExtractOptions& options);

ExtractOptions regularized(ExtractOptions options);

// Extracts, and expects the reference's vertices and triangles in the layers that were counted.
template <class T>
void extract_as_reference(const test::SampleVolume<T>& volume, const ExtractOptions& options,
                          test::ScalarSurface& reference, Mesh& mesh) {
  reference = test::scalar_surface(test::in_doubles(volume).lattice(), options);
  const Lattice<T> lattice = volume.lattice();
  SurfaceWindows windows(lattice, options, {});
  const SurfaceCount& count = windows.count();
  ASSERT_EQ(count.layer_vertices, reference.layer_vertices);
  ASSERT_EQ(count.layer_triangles, reference.layer_triangles);
  windows.write_whole({}, mesh);
  EXPECT_EQ(mesh.origin, lattice.to_space.origin);
  ASSERT_TRUE(test::matches(mesh, reference));
}

template <class T>
void expect_reference_surface(const test::SampleVolume<T>& volume, const ExtractOptions& options) {
  SCOPED_TRACE(describe(volume.dims, options));
  test::ScalarSurface reference;
  Mesh mesh;
  ASSERT_NO_FATAL_FAILURE(extract_as_reference(volume, options, reference, mesh));
  const test::Surface surface = test::surface_of(mesh);
  EXPECT_TRUE(test::is_sound(surface));
  if (options.close) {
    EXPECT_TRUE(test::topology_of(surface).boundary_edges.empty());
  } else {
    EXPECT_TRUE(test::boundary_is_on_border(surface, volume.dims, volume.lattice().to_space));
    expect_extent(surface, reference, options);
  }
}

// Regularised, it is the reference's, too. Vertices that nothing joins stay where they were, and so
// does the topology.
template <class T>
void expect_regular_surface(const test::SampleVolume<T>& volume, const ExtractOptions& options) {
  SCOPED_TRACE(describe(volume.dims, options));
  test::ScalarSurface reference;
  Mesh regular;
  ASSERT_NO_FATAL_FAILURE(extract_as_reference(volume, regularized(options), reference, regular));
  const Mesh plain = test::extracted(volume, options);
  const std::vector<std::uint32_t>& to = reference.becomes;
  ASSERT_EQ(to.size(), plain.positions.size());
  for (std::size_t v = 0; v < to.size(); ++v) {
    if (reference.vertices[to[v]].crossings.size() > 1) continue;
    ASSERT_EQ(plain.positions[v], regular.positions[to[v]]) << "vertex " << v << " has moved";
  }
  ASSERT_TRUE(test::has_topology(regular.triangles.span(), plain.triangles.span(), to));
}

// All four ways. Stops at the first that fails: one is enough to read.
template <class T>
void expect_reference_surfaces(const test::SampleVolume<T>& volume, double iso) {
  for (const ExtractOptions& options : all_options(iso)) {
    expect_reference_surface(volume, options);
    if (testing::Test::HasFailure()) return;
  }
}

template <class T>
void expect_empty(const test::SampleVolume<T>& volume, double iso) {
  for (const ExtractOptions& options : all_options(iso)) {
    SCOPED_TRACE(describe(volume.dims, options));
    const SurfaceCount count = count_surface(volume.lattice(), options, {});
    EXPECT_EQ(count.vertices(), 0U);
    EXPECT_EQ(count.triangles(), 0U);
    const Mesh mesh = test::extracted(volume, options);
    EXPECT_EQ(mesh.positions.size(), 0U);
    EXPECT_EQ(mesh.triangles.size(), 0U);
  }
}

}  // namespace isomesh::mesh
