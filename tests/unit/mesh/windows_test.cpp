#include "server/mesh/extract/windows.h"

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include <gtest/gtest.h>

#include "server/mesh/extract/joined_layers.h"
#include "server/mesh/extract/slab_passes.h"
#include "server/mesh/lattice/bcc_faces.h"
#include "tests/support/errors.h"
#include "tests/support/kernels.h"
#include "tests/support/memory_spool.h"
#include "tests/support/mesh_checks.h"
#include "tests/support/shapes.h"

namespace isomesh::mesh {
namespace {

// Looks at what the count holds whenever a layer is set aside.
class WatchingSpool : public test::MemorySpool {
 public:
  void watch(const std::vector<ClusterLayer>& layers) { layers_ = &layers; }

  void write(std::uint64_t at, std::span<const std::byte> bytes) override {
    std::size_t held = 0;
    for (const ClusterLayer& layer : *layers_) {
      held += layer.words.size() * sizeof(JoiningWord) + layer.joined.size() * sizeof(Joined);
    }
    most_ = std::max(most_, held);
    test::MemorySpool::write(at, bytes);
  }
  std::size_t most() const { return most_; }

 private:
  const std::vector<ClusterLayer>* layers_ = nullptr;
  std::size_t most_ = 0;
};

TEST(SurfaceWindows, HoldWhatOneLayerJoinsWhileTheyCount) {
  const test::ThreadCount one(1);
  const auto most_of = [](std::uint32_t layers) {
    const auto volume =
        test::sample<std::uint8_t>(test::scaled(test::gyroid(8), 50, 60), {24, 24, layers});
    const auto lattice = volume.lattice();
    const ExtractOptions options = {.iso = 60, .regularize = true};
    const Extraction extraction(lattice, options, Threshold<std::uint8_t>{60});
    SurfaceCount count = empty_count(layers);
    count.clusters.resize(layers);
    WatchingSpool spool;
    spool.watch(count.clusters);
    JoinedLayers joined(count.clusters, &spool);
    joined.prepare();
    count_pass(extraction, {}, count, [&](std::uint32_t z) { joined.put_aside(z); });
    return spool.most();
  };
  const std::size_t most = most_of(64);
  EXPECT_EQ(most_of(128), most);
  EXPECT_GT(most, 0U);
}

TEST(ExtractMemory, IsNotTakenForMoreVerticesThanIndicesCanName) {
  const auto volume = test::checkerboard<std::uint8_t>(0, 9, {4, 4, 4});
  const ExtractOptions options = {5, Scheme::kSix, Interpolation::kLinear};
  SurfaceCount count = count_surface(volume.lattice(), options, {});
  count.layer_vertices.back() = std::uint64_t{1} << 33;
  Mesh mesh;
  try {
    make_room(count, volume.lattice().to_space, options.close, mesh);
    FAIL() << "it was not refused";
  } catch (const Error& error) {
    EXPECT_EQ(error.code(), ErrorCode::kTooLarge);
  }
  EXPECT_EQ(mesh.positions.capacity_bytes(), 0U);
  EXPECT_EQ(mesh.triangles.capacity_bytes(), 0U);
}

// Joined crossings that a slab has no business with may be missing or wrong.
TEST(WriteSlab, ReadsJoinedCrossingsOfTwoPlanesBehindAndOneRow) {
  const auto volume = test::noise<std::uint8_t>({0, 1, 60, 61, 200}, {11, 9, 37}, 31);
  const auto lattice = volume.lattice();
  for (const Scheme scheme : test::kSchemes) {
    const ExtractOptions options = {.iso = 60, .scheme = scheme, .regularize = true};
    const SurfaceCount count = count_surface(lattice, options, {});
    const std::size_t rows_of_samples = scheme == Scheme::kBcc ? 2 : 1;
    const auto written = [&](const Slab& slab, const SurfaceCount& from) {
      Extraction extraction(lattice, options, Threshold<std::uint8_t>{60});
      extraction.keep(from.clusters);
      IndexMemory memory(index_memory_size(extraction.dims, kBccPlaces));
      Mesh mesh;
      make_room(from, lattice.to_space, false, mesh);
      std::ranges::fill(mesh.positions, Vec3{});
      std::ranges::fill(mesh.triangles, Triangle{});
      write_slab(extraction, slab, memory, mesh);
      return mesh;
    };
    for (const std::uint32_t begin : {0U, 7U, 30U}) {
      const Slab slab = {begin, begin + 4};
      SurfaceCount poisoned = count;
      for (std::uint32_t z = 0; z < count.clusters.size(); ++z) {
        ClusterLayer& layer = poisoned.clusters[z];
        if (layer.words.empty() || (z >= slab.begin && z < slab.end + 2)) continue;
        const std::size_t kept = z == slab.end + 2 ? layer.row_begin[rows_of_samples] : 0;
        for (std::size_t w = kept; w < layer.words.size(); ++w) {
          layer.words[w] = {~std::uint64_t{0}, 1U << 30, 1U << 30};
        }
      }
      EXPECT_TRUE(test::same_bytes(written(slab, count), written(slab, poisoned)));
    }
  }
}

// As every format that numbers all vertices needs it.
TEST(MakeRoom, RefusesMoreVerticesThanHave32Bits) {
  SurfaceCount count;
  count.layer_vertices = {0, std::uint64_t{1} << 31, std::uint64_t{1} << 32};
  count.layer_triangles = {0, 1, 2};
  Mesh mesh;
  EXPECT_EQ(test::code_thrown_by([&] { make_room(count, {}, false, mesh); }), ErrorCode::kTooLarge);
  EXPECT_EQ(mesh.positions.capacity_bytes(), 0U);
}

TEST(SurfaceSize, TellsTheLargestRunOfLayers) {
  SurfaceCount count;
  count.layer_triangles.resize(51);
  for (std::uint64_t k = 0; k < 50; ++k) {
    count.layer_vertices.push_back(count.layer_vertices.back() + k * k % 17);
  }
  const SurfaceSize size = size_of(count);
  for (std::size_t layers = 0; layers <= 60; ++layers) {
    std::uint64_t most = 0;
    for (std::size_t k = 0; k < 50; ++k) {
      const std::size_t end = std::min<std::size_t>(50, k + layers);
      most = std::max(most, count.layer_vertices[end] - count.layer_vertices[k]);
    }
    if (layers <= size.largest_runs.size()) {
      EXPECT_EQ(size.most_vertices(layers), most);
    } else {
      EXPECT_GE(size.most_vertices(layers), most);
      EXPECT_LE(size.most_vertices(layers), size.vertices);
    }
  }
}

}  // namespace
}  // namespace isomesh::mesh
