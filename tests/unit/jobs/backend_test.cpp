// A second back end: the brute-force reference of the tests, through the whole of a job.
#include "server/jobs/making/backend.h"

#include <span>
#include <string>
#include <vector>

#include <gtest/gtest.h>

#include "proto/samples.h"
#include "server/jobs/making/make_mesh.h"
#include "server/jobs/queue/pipeline.h"
#include "tests/support/errors.h"
#include "tests/support/kernels.h"
#include "tests/support/mesh_checks.h"
#include "tests/support/reference.h"
#include "tests/unit/jobs/fixture.h"

namespace isomesh::jobs {
namespace {

// Meshes of one layer, cell by cell; smoothed over sets of neighbours.
class BruteForce : public Backend {
 public:
  std::string_view name() const override { return "brute force"; }

  mesh::SurfaceSize count(const SampleArray& samples, const mesh::ExtractOptions& options,
                          const mesh::Context& /*context*/) const override {
    const mesh::Mesh mesh = surface(samples, options);
    return {.triangles = mesh.triangles.size(), .vertices = mesh.positions.size()};
  }

  void extract(const SampleArray& samples, const mesh::ExtractOptions& options, const Admit& admit,
               const mesh::Context& context, mesh::Mesh& mesh) const override {
    admit(count(samples, options, context));
    mesh = surface(samples, options);
  }

  mesh::SmoothingEffect smooth(const mesh::SmoothOptions& options, const mesh::Context& /*context*/,
                               mesh::Mesh& mesh) const override {
    mesh::SmoothingEffect effect;
    effect.before = measure_extent(mesh, {});
    std::vector<double> weights;
    for (const mesh::Step& step : options.steps) weights.push_back(step.weight);
    const test::Surface smoothed = test::naively_smoothed(test::surface_of(mesh), weights);
    mesh = in_floats(smoothed);
    effect.after = measure_extent(mesh, {});
    return effect;
  }

 private:
  static mesh::Mesh in_floats(const test::Surface& surface) {
    std::vector<mesh::Vec3> positions;
    for (const auto& [x, y, z] : surface.points) {
      positions.push_back({static_cast<float>(x), static_cast<float>(y), static_cast<float>(z)});
    }
    return test::mesh_of(positions, surface.triangles);
  }

  static mesh::Mesh surface(const SampleArray& samples, const mesh::ExtractOptions& options) {
    return with_sample(samples.type, [&](auto sample) {
      const auto lattice = lattice_of<decltype(sample)>(samples);
      return in_floats(test::reference_surface(lattice, options).surface());
    });
  }
};

struct Made {
  MeshSummary summary;
  mesh::Mesh mesh;
};

class BackendTest : public testing::Test {
 protected:
  BackendTest() { parameters_.regularize = false; }

  Made make(const Backend& backend, std::uint64_t memory_bytes = std::uint64_t{1} << 30) const {
    const codec::Sink nowhere = [](std::span<const std::byte>) {};
    Progress progress({}, kQuiet, {});
    Made made;
    made.summary =
        make_mesh(samples(), request(backend, memory_bytes), {&nowhere, 1}, progress, made.mesh);
    return made;
  }

  SampleArray samples() const {
    const auto& [x, y, z] = volume_.dims;
    return {SampleType::kFloat32,
            {x, y, z},
            volume_.geometry,
            reinterpret_cast<const std::byte*>(volume_.samples.data())};
  }

  MeshRequest request(const Backend& backend, std::uint64_t memory_bytes) const {
    return {.volume = record_,
            .parameters = parameters_,
            .iso = 0,
            .certify = false,
            .memory_bytes = memory_bytes,
            .backend = backend};
  }

  const BruteForce brute_force_;
  const Volume record_;
  MeshParameters parameters_;
  const test::SampleVolume<float> volume_ = test::sample<float>(test::gyroid(9), {14, 13, 12});
};

TEST_F(BackendTest, JobsOfAnotherBackEndHaveTheSameSurface) {
  for (const Smoothing smoothing : {Smoothing::kLaplacian, Smoothing::kTaubin}) {
    parameters_.smoothing = smoothing;
    const Made usual = make(backend_of(kDefaultBackend));
    const Made other = make(brute_force_);
    EXPECT_GT(usual.summary.triangles, 1000U);
    EXPECT_EQ(other.mesh.layers(), 1U);
    EXPECT_EQ(other.summary.triangles, usual.summary.triangles);
    EXPECT_EQ(other.summary.vertices, usual.summary.vertices);
    EXPECT_EQ(other.summary.components, usual.summary.components);
    EXPECT_EQ(other.summary.euler, usual.summary.euler);
    EXPECT_EQ(other.summary.boundary_edges, usual.summary.boundary_edges);
    // The two may cut a patch of four corners into triangles along different diagonals.
    const double area = usual.summary.area_mm2;
    EXPECT_NEAR(other.summary.area_mm2, area, 0.01 * area);
    EXPECT_NEAR(other.summary.volume_mm3.smoothed, usual.summary.volume_mm3.smoothed, 0.01 * area);
  }
}

TEST_F(BackendTest, CountsThroughTheBackEnd) {
  const auto size = [&](const Backend& backend) {
    return count_surface(samples(), request(backend, 1), {}).size;
  };
  const mesh::SurfaceSize usual = size(backend_of(kDefaultBackend));
  EXPECT_GT(usual.triangles, 1000U);
  EXPECT_EQ(size(brute_force_).triangles, usual.triangles);
  EXPECT_EQ(size(brute_force_).vertices, usual.vertices);
}

TEST_F(BackendTest, ARequestThatIsTooLargeEndsBeforeTheSurfaceIsMade) {
  for (const Backend* backend :
       {&backend_of(kDefaultBackend), static_cast<const Backend*>(&brute_force_)}) {
    EXPECT_EQ(test::code_thrown_by([&] { make(*backend, 1000); }), ErrorCode::kTooLarge);
  }
}

TEST(Backends, AreFoundByName) {
  EXPECT_EQ(backend_of("cpu").name(), kDefaultBackend);
  EXPECT_EQ(test::code_thrown_by([] { backend_of("gpu"); }), ErrorCode::kInternal);
}

TEST(Backends, AreInTheKeyOfAResultUnlessTheyAreTheDefault) {
  EXPECT_EQ(mesher_version(), kMesherVersion);
  EXPECT_EQ(mesher_version("cpu"), kMesherVersion);
  EXPECT_NE(mesher_version("brute force"), kMesherVersion);
  EXPECT_NE(mesher_version("brute force"), mesher_version("gpu"));
}

}  // namespace
}  // namespace isomesh::jobs
