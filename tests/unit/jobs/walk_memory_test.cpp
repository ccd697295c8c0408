// The memory of jobs, most of whose files are written while the surface is walked through.
#include <algorithm>
#include <atomic>
#include <cstddef>
#include <cstdint>
#include <string>
#include <vector>

#include <gtest/gtest.h>

#include "base/files.h"
#include "server/jobs/making/make_labels.h"
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

Memory memory_of(const std::vector<std::uint8_t>& samples, const MeshParameters& parameters,
                 bool has_spool = true) {
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
  Memory memory = {.estimated = estimate_memory(surface, samples.size(), parameters, {},
                                                {.has_spool = has_spool})};
  Peak peak;
  WatchedSpool spool(folder.path(), peak);
  if (has_spool) request.spool = &spool;
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

// As on a disk that is full: nothing is set aside.
TEST(EstimateMemory, OfAJobWithoutASpoolHasWhatItKeeps) {
  const test::ThreadCount two(2);
  const std::vector<std::uint8_t> samples = stacked(9, kSide, kLayers);
  for (const MeshFormat format : {MeshFormat::kGlb, MeshFormat::kStl}) {
    const MeshParameters parameters = parameters_for(format, 5);
    const Memory memory = memory_of(samples, parameters, false);
    EXPECT_GE(memory.estimated, memory.counted);
    EXPECT_LE(memory.estimated, 3 * memory.counted);
  }
  const MeshParameters glb = parameters_for(MeshFormat::kGlb, 5);
  EXPECT_GT(memory_of(samples, glb, false).estimated, memory_of(samples, glb).estimated);
}

// The crossings are joined beside the whole surface.
TEST(EstimateMemory, IsCloseToWhatAPlyTakes) { expect_close(parameters_for(MeshFormat::kPly, 0)); }

// A mask with so many cavities that the search for them takes more than all else.
TEST(EstimateMemory, HasTheSearchForCavities) {
  const test::ThreadCount two(2);
  constexpr std::uint32_t kShort = 32;
  constexpr std::uint32_t kMany = 8000;
  std::vector<std::uint8_t> samples(std::size_t{kMany} * kShort * kShort, 255);
  for (std::size_t n = 0; n < samples.size(); ++n) {
    const std::size_t all_odd = n & n / kShort & n / kShort / kShort & 1;
    if (all_odd != 0) samples[n] = 0;
  }
  const SampleArray array = {SampleType::kUint8,
                             {kShort, kShort, kMany},
                             {},
                             reinterpret_cast<const std::byte*>(samples.data())};
  MeshParameters parameters = parameters_for(MeshFormat::kStl, 0);
  parameters.regularize = false;
  const Volume volume;
  const test::TemporaryFolder folder;
  SpoolFile spool(folder.path());
  const MeshRequest request = {.volume = volume,
                               .parameters = parameters,
                               .iso = 128,
                               .measures = {},
                               .memory_bytes = std::uint64_t{1} << 40,
                               .spool = &spool};
  const CountedSurface counted = count_surface(array, request, {});
  ASSERT_TRUE(is_walked(counted.size, parameters, {}));
  const Report nobody = [](Stage /*stage*/, double /*share*/, const Timing& /*timing*/) {};
  Progress progress({}, nobody, {});
  const std::vector<codec::Sink> sinks = {[](std::span<const std::byte> /*bytes*/) {}};
  mesh::Mesh mesh;
  test::HeapPeak peak;
  make_mesh(array, request, sinks, progress, mesh);
  const std::uint64_t taken = peak.bytes();
  const auto estimated = [&](std::uint64_t searching) {
    return estimate_memory(counted.size, samples.size(), parameters, {},
                           {.searching_bytes = searching});
  };
  EXPECT_LT(estimated(0), taken);
  EXPECT_GE(estimated(counted.searching_bytes), taken);
  EXPECT_LE(estimated(counted.searching_bytes), 3 * taken);
}

// Two large slices with a little surface between them, which is written with the indices of whole
// planes of samples.
Memory memory_of_slices(std::uint32_t side, const MeshParameters& parameters) {
  std::vector<std::uint8_t> samples(std::size_t{2} * side * side, 0);
  for (std::size_t z = 0; z < 2; ++z) samples[z * side * side + side * 5 + 5] = 255;
  const SampleArray array = {
      SampleType::kUint8, {side, side, 2}, {}, reinterpret_cast<const std::byte*>(samples.data())};
  const Volume volume;
  const MeshRequest request = {.volume = volume,
                               .parameters = parameters,
                               .iso = 128,
                               .measures = {},
                               .memory_bytes = std::uint64_t{1} << 40};
  const CountedSurface counted =
      parameters.labels ? count_labels(array, parameters, {}) : count_surface(array, request, {});
  const mesh::SurfaceSize& surface = counted.size;
  EXPECT_FALSE(is_walked(surface, parameters, {}));
  const Report nobody = [](Stage /*stage*/, double /*share*/, const Timing& /*timing*/) {};
  Progress progress({}, nobody, {});
  const std::vector<codec::Sink> sinks = {[](std::span<const std::byte> /*bytes*/) {}};
  mesh::Mesh mesh;
  mesh::SeparatingSurface walls;
  test::HeapPeak peak;
  if (parameters.labels) {
    make_labels(array, request, sinks, progress, walls);
  } else {
    make_mesh(array, request, sinks, progress, mesh);
  }
  return {.estimated = estimate_memory(surface, samples.size(), parameters, {},
                                       {.searching_bytes = counted.searching_bytes}),
          .counted = peak.bytes()};
}

// On a busy machine, a look at the memory may miss its peak, so the most of several runs counts.
void expect_enough_for_slices(std::uint32_t side, const MeshParameters& parameters,
                              std::uint64_t factor) {
  constexpr int kRuns = 50;
  const test::ThreadCount one(1);
  Memory most;
  for (int run = 0; run < kRuns && most.estimated >= factor * most.counted; ++run) {
    const Memory memory = memory_of_slices(side, parameters);
    EXPECT_GE(memory.estimated, memory.counted);
    most = {memory.estimated, std::max(most.counted, memory.counted)};
  }
  EXPECT_LE(most.estimated, factor * most.counted);
}

TEST(EstimateMemory, IsEnoughForAClosedSurfaceInTwoLargeSlices) {
  MeshParameters parameters = parameters_for(MeshFormat::kPly, 0);
  parameters.close = true;
  expect_enough_for_slices(2000, parameters, 2);
}

// The proof reads the samples with ten layers of others on each side.
TEST(EstimateMemory, IsEnoughForTheProofOfAClosedSurfaceInTwoLargeSlices) {
  MeshParameters parameters = parameters_for(MeshFormat::kPly, 0);
  parameters.close = true;
  parameters.max_error_mm = 8;
  for (const SchemeName scheme : {SchemeName::kSix, SchemeName::kBcc}) {
    parameters.scheme = scheme;
    expect_enough_for_slices(1000, parameters, 3);
  }
}

TEST(EstimateMemory, IsEnoughForALabelInTwoLargeSlices) {
  MeshParameters parameters = label_parameters({});
  parameters.formats = {MeshFormat::kGlb};
  for (const bool close : {false, true}) {
    parameters.close = close;
    expect_enough_for_slices(1000, parameters, 2);
  }
}

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
