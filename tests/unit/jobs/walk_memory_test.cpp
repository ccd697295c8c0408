// The memory of jobs, most of whose files are written while the surface is walked through.
#include <algorithm>
#include <atomic>
#include <cstddef>
#include <cstdint>
#include <string>
#include <vector>

#include <gtest/gtest.h>

#include "base/files.h"
#include "server/jobs/making/make_mesh.h"
#include "server/jobs/making/mesh_cost.h"
#include "server/jobs/making/spool_file.h"
#include "tests/support/files.h"
#include "tests/support/heap.h"
#include "tests/support/kernels.h"
#include "tests/support/shapes.h"

namespace isomesh::jobs {
namespace {

// The most memory that was taken whenever somebody looked. Thread safe.
class Peak {
 public:
  void look() {
    const std::size_t now = test::heap_bytes();
    std::size_t most = most_;
    while (now > most && !most_.compare_exchange_weak(most, now)) {
    }
  }
  std::uint64_t bytes() const { return most_ - first_; }

 private:
  const std::size_t first_ = test::heap_bytes();
  std::atomic<std::size_t> most_ = first_;
};

class WatchedSpool : public SpoolFile {
 public:
  WatchedSpool(const std::filesystem::path& folder, Peak& peak) : SpoolFile(folder), peak_(peak) {}

  void write(std::uint64_t at, std::span<const std::byte> bytes) override {
    peak_.look();
    SpoolFile::write(at, bytes);
  }
  void read(std::uint64_t at, std::span<std::byte> bytes) const override {
    SpoolFile::read(at, bytes);
    peak_.look();
  }

 private:
  Peak& peak_;
};

// So many times the same layers, and one whose surface is many times as large.
std::vector<std::uint8_t> stacked(std::uint32_t times, std::uint32_t side, std::uint32_t layers) {
  const auto once =
      test::sample<std::uint8_t>(test::scaled(test::gyroid(16), 50, 128), {side, side, layers});
  std::vector<std::uint8_t> all;
  for (std::uint32_t n = 0; n < times; ++n) {
    all.insert(all.end(), once.samples.begin(), once.samples.end());
  }
  for (std::uint32_t i = 0; i < side * side; ++i) {
    all[std::size_t{2} * layers * side * side + i] = (i / 4 + i / side / 4) % 2 == 0 ? 0 : 255;
  }
  return all;
}

constexpr std::uint32_t kSide = 128;
constexpr std::uint32_t kLayers = 32;

struct Memory {
  std::uint64_t estimated = 0;
  std::uint64_t counted = 0;
};

Memory memory_of(const std::vector<std::uint8_t>& samples, const MeshParameters& parameters) {
  const test::TemporaryFolder folder;
  const auto layers = static_cast<std::uint32_t>(samples.size() / (kSide * kSide));
  const SampleArray array = {SampleType::kUint8,
                             {kSide, kSide, layers},
                             {},
                             reinterpret_cast<const std::byte*>(samples.data())};
  const Volume volume;
  MeshRequest request = {.volume = volume,
                         .parameters = parameters,
                         .iso = 128,
                         .measures = {},
                         .memory_bytes = std::uint64_t{1} << 40};
  const mesh::SurfaceSize surface = count_surface(array, request, {}).size;
  EXPECT_TRUE(sets_aside(samples.size()));
  EXPECT_EQ(is_walked(surface, parameters, {}), parameters.formats.front() != MeshFormat::kPly);
  Memory memory = {.estimated = estimate_memory(surface, samples.size(), parameters, {})};
  Peak peak;
  WatchedSpool spool(folder.path(), peak);
  request.spool = &spool;
  const Report report = [&](Stage /*stage*/, double /*share*/, const Timing& /*timing*/) {
    peak.look();
  };
  Progress progress({}, report, {});
  const std::vector<codec::Sink> sinks = {
      [&](std::span<const std::byte> /*bytes*/) { peak.look(); }};
  mesh::Mesh mesh;
  make_mesh(array, request, sinks, progress, mesh);
  memory.counted = peak.bytes();
  return memory;
}

// A factor of more would keep jobs waiting whose memory is there, and less is not enough.
void expect_close(const MeshParameters& parameters) {
  const test::ThreadCount two(2);
  const auto [estimated, counted] = memory_of(stacked(9, kSide, kLayers), parameters);
  EXPECT_GE(estimated, counted);
  EXPECT_LE(estimated, 2 * counted);
}

MeshParameters parameters_for(MeshFormat format, int passes) {
  MeshParameters parameters;
  parameters.formats = {format};
  parameters.passes = passes;
  return parameters;
}

TEST(EstimateMemory, IsCloseToWhatAnStlTakes) {
  expect_close(parameters_for(MeshFormat::kStl, 20));
}

TEST(EstimateMemory, IsCloseToWhatTheBodyCentredLatticeTakes) {
  MeshParameters parameters = parameters_for(MeshFormat::kStl, 1);
  parameters.scheme = SchemeName::kBcc;
  expect_close(parameters);
}

TEST(EstimateMemory, IsCloseToWhatAGlbTakes) { expect_close(parameters_for(MeshFormat::kGlb, 5)); }

// The crossings are joined beside the whole surface.
TEST(EstimateMemory, IsCloseToWhatAPlyTakes) { expect_close(parameters_for(MeshFormat::kPly, 0)); }

TEST(WalkMemory, IsTheSameForTwiceAsManyLayers) {
  const test::ThreadCount one(1);
  const MeshParameters parameters = parameters_for(MeshFormat::kStl, 2);
  const Memory once = memory_of(stacked(9, kSide, kLayers), parameters);
  const Memory twice = memory_of(stacked(18, kSide, kLayers), parameters);
  EXPECT_LT(twice.counted, once.counted * 21 / 20);
  EXPECT_LT(twice.estimated, once.estimated * 21 / 20);
}

}  // namespace
}  // namespace isomesh::jobs
