// Synthetic volumes: fields sampled on a lattice, noise, and single cells. Deterministic: equal
// arguments give equal samples on every machine.
#pragma once

#include <array>
#include <cstdint>
#include <functional>
#include <string>
#include <vector>

#include "proto/types.h"
#include "server/mesh/lattice/lattice.h"

namespace isomesh::test {

using Point = std::array<double, 3>;

// The map of a geometry, implemented independently of the kernels.
mesh::LatticeToSpace space_of(const Geometry& geometry);

// Converts a point from lattice units to millimetres, and back. `map` must not be degenerate.
Point to_space(const mesh::LatticeToSpace& map, const Point& lattice_point);
Point to_lattice(const mesh::LatticeToSpace& map, const Point& space_point);

// Owned samples. Instantiated, like everything below, for the eight types of SampleType.
template <class T>
struct SampleVolume {
  std::vector<T> samples;  // x fastest
  mesh::Dims dims;
  Geometry geometry;

  // A view, valid until this volume is moved or changed.
  mesh::Lattice<T> lattice() const { return {samples.data(), dims, space_of(geometry)}; }

  T& at(std::uint64_t i, std::uint64_t j, std::uint64_t k) {
    return samples[(k * dims.y + j) * dims.x + i];
  }
};

// A smooth function of a point in millimetres.
using Field = std::function<double(const Point&)>;

// Distances to the surface, positive inside.
Field sphere(const Point& centre, double radius);
Field torus(const Point& centre, double major_radius, double minor_radius);  // around the z axis
Field plane(const Point& unit_normal, double offset);  // inside where normal * p < offset

// sin x cos y + sin y cos z + sin z cos x, with periods of `period` millimetres.
Field gyroid(double period);

// The quartic whose surface in [-scale, scale]^3 has five handles, shrunk to the cube [-1, 1]^3.
Field tangle_cube(double scale);

Field scaled(const Field& field, double gain, double offset);

// The field at every sample, rounded to the nearest and saturated for integers.
template <class T>
SampleVolume<T> sample(const Field& field, const mesh::Dims& dims, const Geometry& geometry = {});

// A lattice of `n` samples along each axis that spans the cube [-1, 1]^3.
mesh::Dims unit_cube_dims(std::uint32_t n);
Geometry unit_cube_geometry(std::uint32_t n);

// Each sample is one of `values`, uniformly distributed.
template <class T>
SampleVolume<T> noise(const std::vector<T>& values, const mesh::Dims& dims, std::uint64_t seed,
                      const Geometry& geometry = {});

// Each sample is uniformly distributed in [low, high].
template <class T>
SampleVolume<T> noise_between(double low, double high, const mesh::Dims& dims, std::uint64_t seed);

// A sphere's wall of about the thickness of a voxel, thicker with a larger seed, in noise: both of
// its sides want the same samples. Iso-value 0.
SampleVolume<float> thin_shell(std::uint32_t seed);

template <class T>
SampleVolume<T> constant(T value, const mesh::Dims& dims);

// `even` if i+j+k is even, otherwise `odd`: every axis edge is crossed.
template <class T>
SampleVolume<T> checkerboard(T even, T odd, const mesh::Dims& dims);

// Sets all samples on the lattice's six faces, so that a surface inside is closed.
template <class T>
void set_border(SampleVolume<T>& volume, T value);

enum class Parity { kEven, kOdd };          // of i+j+k
enum class Surround { kOutside, kInside };  // the samples around a cell

// One cell of the given parity, with a layer of other samples around it. Its corner c (the paper's
// numbering) is inside if bit c of `pattern` is set. All corners have different values, and corner
// 0, if inside, has the iso-value itself.
inline constexpr double kPatternIso = 100;
template <class T>
SampleVolume<T> sign_pattern(unsigned pattern, Parity parity, Surround surround);

// Typical geometries of scanners.
Geometry anisotropic_geometry();
Geometry oblique_geometry();
Geometry left_handed_geometry();          // axis-aligned, one axis reversed
Geometry oblique_left_handed_geometry();  // rotated, anisotropic and reversed
Geometry tilted_geometry();               // sheared: CT slices with a gantry tilt of 20 degrees
Geometry far_geometry();                  // fine samples more than a metre from the origin
Geometry oblique_far_geometry();

struct NamedGeometry {
  std::string name;
  Geometry geometry;
};
std::vector<NamedGeometry> all_geometries();

}  // namespace isomesh::test
