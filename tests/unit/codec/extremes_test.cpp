// Whole jobs on samples and spacings at the ends of what is accepted: every number in every file is
// finite, and a power of two changes no digit.
#include <algorithm>
#include <cmath>
#include <limits>
#include <map>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include <gtest/gtest.h>

#include "proto/samples.h"
#include "server/codec/formats.h"
#include "server/jobs/making/make_labels.h"
#include "server/jobs/making/make_mesh.h"
#include "tests/support/shapes.h"
#include "tests/unit/codec/decode.h"
#include "tests/unit/codec/foreign.h"
#include "tests/unit/codec/glb_container.h"
#include "tests/unit/codec/meshes.h"
#include "tests/unit/codec/usd_reader.h"

namespace isomesh::codec {
namespace {

constexpr mesh::Dims kDims = {12, 12, 13};

struct Made {
  mesh::Mesh mesh;
  std::map<MeshFormat, std::string> files;
};

template <class T>
Made made(const test::SampleVolume<T>& volume, double iso, const MeshParameters& parameters) {
  const auto& [x, y, z] = volume.dims;
  const jobs::SampleArray samples = {sample_type<T>(),
                                     {x, y, z},
                                     volume.geometry,
                                     reinterpret_cast<const std::byte*>(volume.samples.data())};
  Made made;
  std::vector<Sink> sinks;
  for (const MeshFormat format : files_of(parameters)) {
    sinks.push_back([&file = made.files[format]](std::span<const std::byte> piece) {
      file.append(reinterpret_cast<const char*>(piece.data()), piece.size());
    });
  }
  constexpr std::uint64_t kMemory = std::uint64_t{1} << 30;
  const Volume named;
  const jobs::MeshRequest request = {named, parameters, iso, {}, kMemory};
  const jobs::Report ignore = [](Stage, double, const Timing&) {};
  jobs::Progress progress({}, ignore, {});
  if (parameters.labels) {
    mesh::SeparatingSurface walls;
    jobs::make_labels(samples, request, sinks, progress, walls);
    made.mesh = std::move(walls.mesh);
  } else {
    jobs::make_mesh(samples, request, sinks, progress, made.mesh);
  }
  return made;
}

double from_ball(const test::Point& sample) {
  return std::hypot(sample[0] - 6, sample[1] - 6, sample[2] - 6) - 4.3;
}

// The field of a place in numbers of samples.
template <class T>
test::SampleVolume<T> sampled(const test::Field& field, const mesh::Dims& dims,
                              const Geometry& geometry = {}) {
  test::SampleVolume<T> volume = test::sample<T>(field, dims);
  volume.geometry = geometry;
  return volume;
}

Geometry oblique(double spacing) {
  Geometry geometry = test::oblique_geometry();
  geometry.spacing = {spacing, spacing, spacing};
  geometry.origin = {10 * spacing, -5 * spacing, 0};
  return geometry;
}

// Three parts of a ball, which touch.
test::SampleVolume<std::uint8_t> three_labels(const Geometry& geometry) {
  return sampled<std::uint8_t>(
      [](const test::Point& p) {
        if (from_ball(p) > 0) return 0;
        return p[0] < 6 ? 1 : p[1] < 6 ? 2 : 3;
      },
      kDims, geometry);
}

bool all_finite(std::span<const float> numbers) {
  return std::ranges::all_of(numbers, [](float number) { return std::isfinite(number); });
}

bool all_finite(std::span<const mesh::Vec3> points) {
  return std::ranges::all_of(points, [](const mesh::Vec3& point) { return all_finite(point); });
}

bool all_units(std::span<const mesh::Vec3> normals) {
  return std::ranges::all_of(normals, [](const mesh::Vec3& n) {
    return std::abs(std::hypot(double{n[0]}, double{n[1]}, double{n[2]}) - 1) < 0.01;
  });
}

void expect_finite_stream(std::string_view drc) {
  EXPECT_TRUE(std::ranges::all_of(test::attributes_in_process(drc),
                                  [](const auto& numbers) { return all_finite(numbers); }));
}

// The streams of the primitives of a GLB file.
std::vector<std::string> streams_of(const std::string& file) {
  const test::GlbContainer glb = test::open_container(file);
  std::vector<std::string> streams;
  for (const auto& view : glb.document["bufferViews"]) {
    streams.push_back(glb.binary.substr(view["byteOffset"].get<std::size_t>(),
                                        view["byteLength"].get<std::size_t>()));
  }
  return streams;
}

void expect_finite_usd(const std::string& text) {
  for (const test::UsdMesh& mesh : test::read_usda(text).meshes) {
    EXPECT_TRUE(all_finite(mesh.points));
    EXPECT_TRUE(all_units(mesh.normals));
  }
}

void expect_finite_corners(const std::string& file, MeshFormat format) {
  const auto triangles = test::read_exactly(file, format);
  EXPECT_FALSE(triangles.empty());
  EXPECT_TRUE(
      std::ranges::all_of(triangles, [](const auto& corners) { return all_finite(corners); }));
}

void expect_finite_glb_in_node(const std::string& file) {
  for (const test::GlbPrimitive& primitive : test::read_with_node(file)) {
    EXPECT_TRUE(all_finite(primitive.mesh.points));
    EXPECT_TRUE(all_units(primitive.normals));
    EXPECT_TRUE(all_finite(primitive.distances));
  }
}

// Other programs take their time to start.
enum class Readers { kInProcess, kAll };

void expect_finite(const Made& made, const MeshParameters& parameters, Readers readers) {
  ASSERT_GT(made.mesh.triangles.size(), 0U);
  for (const auto& [format, file] : made.files) {
    SCOPED_TRACE(to_string(format));
    if (format == MeshFormat::kDrc) {
      expect_finite_stream(file);
    } else if (format == MeshFormat::kGlb) {
      if (readers == Readers::kAll) expect_finite_glb_in_node(file);
      if (parameters.glb_codec != GlbCodec::kDraco) continue;
      for (const std::string& stream : streams_of(file)) expect_finite_stream(stream);
    } else if (format == MeshFormat::kUsda) {
      expect_finite_usd(file);
    } else if (format == MeshFormat::kUsdz) {
      expect_finite_usd(test::first_file_of_usdz(file));
    } else if (readers == Readers::kAll || !test::is_read_by_python(format)) {
      expect_finite_corners(file, format);
    }
  }
}

struct NamedParameters {
  std::string name;
  MeshParameters parameters;
};

// Lengths are in spacings.
std::vector<NamedParameters> kinds_of_jobs(double spacing) {
  MeshParameters parameters;
  parameters.formats = test::formats_of_a_surface();
  MeshParameters few = parameters;
  few.triangles = 150;
  few.distances = true;
  few.draco.speed = 0;
  few.lods = {1, 0.5};
  MeshParameters near = parameters;
  near.max_error_mm = 0.3 * spacing;
  near.smoothing = Smoothing::kTaubin;
  MeshParameters even = parameters;
  even.smoothing = Smoothing::kOptimize;
  even.formats = {MeshFormat::kGlb, MeshFormat::kUsda};
  even.close = true;
  even.glb_codec = GlbCodec::kMeshopt;
  even.distances = true;
  return {{"few", few}, {"near", near}, {"even", even}};
}

template <class T>
void expect_finite_jobs(const test::SampleVolume<T>& volume, double spacing,
                        Readers readers = Readers::kInProcess) {
  for (const auto& [name, parameters] : kinds_of_jobs(spacing)) {
    SCOPED_TRACE(name);
    // One job of each codec is enough for those.
    const bool is_read_in_process = parameters.max_error_mm.has_value();
    expect_finite(made(volume, 0, parameters), parameters,
                  is_read_in_process ? Readers::kInProcess : readers);
  }
}

TEST(Extremes, OfSamplesLeaveFilesFinite) {
  constexpr double kLeast = std::numeric_limits<double>::denorm_min();
  for (const double scale : {kLeast, 1e-310, 1e-170, -1e-160, 1e-30, 1e30, 1e170, 2e307}) {
    SCOPED_TRACE(scale);
    expect_finite_jobs(
        sampled<double>([&](const test::Point& p) { return scale * from_ball(p); }, kDims), 1,
        scale == 1e-170 ? Readers::kAll : Readers::kInProcess);
  }
  for (const double scale : {1e-44, 1e37}) {
    SCOPED_TRACE(scale);
    expect_finite_jobs(
        sampled<float>([&](const test::Point& p) { return scale * from_ball(p); }, kDims), 1);
  }
}

TEST(Extremes, OfSpacingsLeaveFilesFinite) {
  for (const double spacing : {1e-6, 1e-4, 1e3, 1e6}) {
    SCOPED_TRACE(spacing);
    expect_finite_jobs(sampled<float>(from_ball, kDims, oblique(spacing)), spacing,
                       spacing == 1e-6 ? Readers::kAll : Readers::kInProcess);
    MeshParameters labels = label_parameters({});
    labels.formats = {MeshFormat::kGlb, MeshFormat::kUsda, MeshFormat::k3mf};
    labels.triangles = 300;
    expect_finite(made(three_labels(oblique(spacing)), 0, labels), labels, Readers::kInProcess);
  }
}

// Vertices and triangles, and normals if the mesh has its own.
void expect_same(const mesh::Mesh& mesh, const mesh::Mesh& other, double scale) {
  ASSERT_EQ(mesh.positions.size(), other.positions.size());
  ASSERT_TRUE(std::ranges::equal(mesh.triangles, other.triangles));
  EXPECT_TRUE(std::ranges::equal(mesh.normals, other.normals));
  const auto is_scaled = [&](const mesh::Vec3& a, const mesh::Vec3& b) {
    return std::ranges::equal(a, b, [&](float x, float y) { return x * scale == y; });
  };
  EXPECT_TRUE(std::ranges::equal(mesh.positions, other.positions, is_scaled));
}

void expect_no_other_digits(const test::Field& field, const std::vector<double>& scales) {
  const auto surface_of = [&](double scale, MeshParameters parameters) {
    parameters.formats = {MeshFormat::kStl};
    const auto volume =
        sampled<double>([&](const test::Point& p) { return scale * field(p); }, kDims);
    return made(volume, 0, parameters).mesh;
  };
  for (const auto& [name, parameters] : kinds_of_jobs(1)) {
    SCOPED_TRACE(name);
    const mesh::Mesh mesh = surface_of(1, parameters);
    for (const double scale : scales) {
      SCOPED_TRACE(scale);
      expect_same(mesh, surface_of(scale, parameters), 1);
    }
  }
}

TEST(Extremes, OfSamplesChangeNoDigit) {
  expect_no_other_digits(from_ball, {0x1p-990, 0x1p-600, 0x1p600, 0x1p1020});
  // The difference of two samples is larger than a double can be.
  expect_no_other_digits([](const test::Point& p) { return from_ball(p) < 0 ? 1.5 : -1; },
                         {0x1p-1022, 0x1p1023});
}

TEST(Extremes, OfSpacingsChangeNoDigit) {
  const auto each_job = [](double spacing) {
    std::vector<std::pair<std::string, mesh::Mesh>> meshes;
    const auto ball = sampled<float>(from_ball, kDims, oblique(spacing));
    for (auto [name, parameters] : kinds_of_jobs(spacing)) {
      parameters.formats = {MeshFormat::kStl};
      meshes.emplace_back(name, made(ball, 0, parameters).mesh);
      parameters.passes = 0;
      parameters.scheme = SchemeName::kFive;
      meshes.emplace_back(name + " as it is", made(ball, 0, parameters).mesh);
    }
    return meshes;
  };
  const auto meshes = each_job(1);
  for (const double spacing : {0x1p-19, 0x1p19}) {
    const auto others = each_job(spacing);
    for (std::size_t i = 0; i < meshes.size(); ++i) {
      SCOPED_TRACE(meshes[i].first + " at " + std::to_string(spacing));
      expect_same(meshes[i].second, others[i].second, spacing);
    }
  }
}

TEST(Extremes, OfSpacingsOfLabelsChangeNoDigit) {
  for (const bool close : {false, true}) {
    SCOPED_TRACE(close);
    MeshParameters parameters = label_parameters({});
    parameters.formats = {MeshFormat::kPly};
    parameters.close = close;
    const auto walls = [&](double spacing) {
      return made(three_labels(oblique(spacing)), 0, parameters).mesh;
    };
    const mesh::Mesh mesh = walls(1);
    for (const double spacing : {0x1p-16, 0x1p16}) {
      SCOPED_TRACE(spacing);
      expect_same(mesh, walls(spacing), spacing);
    }
  }
}

// A plane that smoothing moves by rounding alone. Kept with six decimals, the distances' range was
// zero.
TEST(Extremes, OfDistancesAreDecoded) {
  Geometry geometry;
  geometry.spacing = {0.1, 0.1, 0.1};
  geometry.direction = {0.36, 0.48, -0.8, -0.8, 0.6, 0, 0.48, 0.64, 0.6};
  const auto volume = sampled<std::uint8_t>(
      [](const test::Point& p) { return p[0] >= 10 ? 200 : 0; }, {20, 20, 20}, geometry);
  for (const int speed : {0, 1, 4, 7, 10}) {
    SCOPED_TRACE(speed);
    MeshParameters parameters;
    parameters.formats = {MeshFormat::kGlb};
    parameters.distances = true;
    parameters.normals = false;
    parameters.draco.speed = speed;
    const Made plane = made(volume, 77, parameters);
    const auto streams = streams_of(plane.files.at(MeshFormat::kGlb));
    ASSERT_EQ(streams.size(), 1U);
    const auto attributes = test::attributes_in_process(streams[0]);
    ASSERT_EQ(attributes.size(), 2U);
    EXPECT_TRUE(all_finite(attributes[0]));
    EXPECT_TRUE(all_finite(attributes[1]));
    const float most = std::ranges::max(attributes[1]);
    EXPECT_GT(most, 1e-9F);
    EXPECT_LT(most, 5e-7F);
  }
}

}  // namespace
}  // namespace isomesh::codec
