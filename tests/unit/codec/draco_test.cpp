// Our own encoder of Draco streams, held against libdraco's decoder.
#include <algorithm>
#include <array>
#include <atomic>
#include <cmath>
#include <cstdint>
#include <limits>
#include <new>
#include <string>
#include <thread>
#include <vector>

#include <gtest/gtest.h>

#include "server/codec/draco/chunks.h"
#include "server/codec/draco/encoder.h"
#include "server/codec/encode.h"
#include "tests/support/errors.h"
#include "tests/support/kernels.h"
#include "tests/unit/codec/decode.h"
#include "tests/unit/codec/foreign.h"
#include "tests/unit/codec/made_up_meshes.h"
#include "tests/unit/codec/meshes.h"
#include "tests/unit/codec/stream_check.h"

namespace isomesh::codec::edgebreaker {
namespace {

using test::decode_in_process;
using test::difference;
using test::MaySplit;
using test::mesh_of;

constexpr int kBits = 14;

Surface surface_of(const mesh::Mesh& mesh) {
  return {mesh.positions.span(), mesh.triangles.span(), mesh.layer_vertices, mesh.layer_triangles};
}

std::optional<Encoded> ours(const mesh::Mesh& mesh, Threads threads = Threads::kAll,
                            int bits = kBits) {
  return Encoder().encode(surface_of(mesh), grid_of(mesh, bits), threads, {});
}

std::string text_of(const Encoded& encoded) {
  return {reinterpret_cast<const char*>(encoded.bytes.data()), encoded.bytes.size()};
}

// Encodes by our own encoder and expects that what libdraco decodes is the mesh.
void expect_ours(const mesh::Mesh& mesh, MaySplit may_split = MaySplit::kNo, int bits = kBits) {
  const auto encoded = ours(mesh, Threads::kAll, bits);
  ASSERT_TRUE(encoded) << "it was refused";
  const test::DecodedMesh decoded = decode_in_process(text_of(*encoded));
  EXPECT_EQ(difference(decoded, mesh, bits, may_split), "");
  EXPECT_EQ(decoded.points.size(), encoded->vertices);
}

mesh::Mesh surface_in(const test::Field& field, const mesh::Dims& dims, bool close) {
  return test::extracted(test::sample<float>(field, dims),
                         {.iso = 0, .scheme = Scheme::kSix, .close = close});
}

// A box with holes through it: its genus is their number.
mesh::Mesh with_handles(int handles) {
  const mesh::Dims dims = {static_cast<std::uint32_t>(4 * handles + 5), 9, 7};
  return surface_in(
      [&](const test::Point& p) {
        const bool in_box = p[0] > 0.6 && p[0] < 4 * handles + 3.4 && p[1] > 0.6 && p[1] < 7.4 &&
                            p[2] > 0.6 && p[2] < 5.4;
        const auto across = static_cast<int>(p[0]) % 4;
        const bool in_hole =
            p[0] > 3.5 && p[0] < 4 * handles + 1.5 && across < 2 && p[1] > 2.5 && p[1] < 5.5;
        return in_box && !in_hole ? 1.0 : -1.0;
      },
      dims, false);
}

TEST(OwnDraco, EncodesTheUsualShapes) {
  for (const auto& [name, mesh] : test::meshes_to_encode()) {
    SCOPED_TRACE(name);
    expect_ours(mesh);
  }
  expect_ours(test::large_mesh());
}

TEST(OwnDraco, EncodesHandles) {
  for (const int handles : {0, 1, 2, 7, 30, 100}) {
    SCOPED_TRACE(handles);
    const mesh::Mesh mesh = with_handles(handles);
    const auto vertices = static_cast<std::int64_t>(mesh.positions.size());
    const auto triangles = static_cast<std::int64_t>(mesh.triangles.size());
    ASSERT_EQ(vertices - triangles / 2, 2 - 2 * handles) << "that is no surface of this genus";
    expect_ours(mesh);
  }
}

TEST(OwnDraco, EncodesThousandsOfPieces) {
  const mesh::Mesh mesh = test::extracted(
      test::checkerboard<std::uint8_t>(0, 1, {21, 21, 21}),
      {.iso = 0.5, .scheme = Scheme::kFive, .interpolation = Interpolation::kMidpoint});
  ASSERT_GT(mesh.triangles.size(), 5000U);
  expect_ours(mesh);
}

TEST(OwnDraco, EncodesNoise) {
  for (const std::uint64_t seed : {1, 2, 3}) {
    for (const bool close : {false, true}) {
      const mesh::Mesh mesh =
          test::extracted(test::noise_between<float>(0, 1, {30, 25, 20}, seed),
                          {.iso = 0.3 + 0.1 * static_cast<double>(seed), .close = close});
      expect_ours(mesh);
    }
  }
}

// A mesh of that length, beside the origin.
mesh::Mesh of_length(double length) {
  mesh::Mesh mesh = surface_in(test::sphere({8, 7, 6}, 4.7), {16, 14, 12}, false);
  for (mesh::Vec3& position : mesh.positions) {
    for (float& coordinate : position) {
      coordinate = static_cast<float>((coordinate - 2.1) * length / 9.4);
    }
  }
  return mesh;
}

// libdraco keeps its options as text.
TEST(OwnDraco, AndLibdracoDecodeToTheSameBits) {
  for (const double length : {1e-32, 1e-20, 1e-6, 1e-3, 0.05, 1.0, 100.0, 1e9}) {
    SCOPED_TRACE(length);
    const mesh::Mesh mesh = of_length(length);
    const Grid grid = grid_of(mesh, kBits);
    std::vector<mesh::Vec3> expected;
    double farthest = 0;
    for (const mesh::Vec3& position : mesh.positions) {
      mesh::Vec3& decoded = expected.emplace_back();
      for (std::size_t axis = 0; axis < 3; ++axis) {
        decoded[axis] = grid.decoded(position[axis], axis);
        farthest = std::max(farthest, std::abs(double{decoded[axis]} - position[axis]));
      }
    }
    EXPECT_LE(farthest, 0.52 * length / ((1 << kBits) - 1));
    std::ranges::sort(expected);
    for (const int speed : {0, 3, 7, 10}) {
      SCOPED_TRACE(speed);
      test::DecodedMesh decoded =
          decode_in_process(test::encoded(mesh, MeshFormat::kDrc, DracoParameters{kBits, speed}));
      std::ranges::sort(decoded.points);
      EXPECT_TRUE(std::ranges::equal(decoded.points, expected));
    }
    EXPECT_TRUE(ours(mesh));
  }
}

TEST(OwnDraco, GridsOfUsualSizesHaveSixDecimals) {
  const Grid grid = grid_of(mesh_of({{0.1234567F, -3, 2}, {1, 1, 1}}, {}), kBits);
  EXPECT_EQ(grid.low, (mesh::Vec3{0.123457F, -3, 1}));
  EXPECT_EQ(grid.side, 4.000001F);
  EXPECT_EQ(range_from_zero(0.1234567F, 12), 0.123457F);
  EXPECT_EQ(range_from_zero(1.2345e-7F, 12), 1.2345e-7F);
  EXPECT_EQ(range_from_zero(0, 12), 1);
}

TEST(OwnDraco, AGridOfOnePointHasSteps) {
  for (const int bits : {1, 14, 30}) {
    const Grid grid = grid_of(mesh_of({{1e-40F, 7, -1e6F}}, {}), bits);
    EXPECT_TRUE(std::isnormal(grid.side / static_cast<float>((1 << bits) - 1)));
    EXPECT_TRUE(std::isfinite(static_cast<float>((1 << bits) - 1) / grid.side));
    EXPECT_EQ(grid.decoded(7, 1), 7);
  }
}

TEST(OwnDraco, NormalsWithoutADirectionAreSomeDirection) {
  const mesh::Mesh mesh = of_length(1);
  constexpr float kInfinity = std::numeric_limits<float>::infinity();
  const std::vector<mesh::Vec3> normals(mesh.positions.size(), {kInfinity, 0, -kInfinity});
  Surface surface = surface_of(mesh);
  surface.normals = normals;
  const auto encoded = Encoder().encode(surface, grid_of(mesh, kBits), Threads::kOne, {});
  ASSERT_TRUE(encoded);
  const auto attributes = test::attributes_in_process(text_of(*encoded));
  ASSERT_EQ(attributes.size(), 2U);
  for (std::size_t i = 0; i < attributes[1].size(); i += 3) {
    EXPECT_NEAR(std::hypot(attributes[1][i], attributes[1][i + 1], attributes[1][i + 2]), 1, 0.01);
  }
}

TEST(OwnDraco, EncodesOnEveryGridThatItCovers) {
  const mesh::Mesh mesh = test::large_mesh();
  for (const int bits : {1, 2, 3, 5, 8, 11, 14, 16}) {
    SCOPED_TRACE(bits);
    expect_ours(mesh, MaySplit::kNo, bits);
  }
  EXPECT_FALSE(ours(mesh, Threads::kAll, 17));
}

TEST(OwnDraco, EncodesVerticesOfSeveralOpenFansAsSeveral) {
  // Two triangles that touch at a vertex, and a ring of four that do so twice.
  expect_ours(
      mesh_of({{0, 0, 0}, {1, 0, 0}, {0, 1, 0}, {2, 1, 0}, {1, 2, 0}}, {{0, 1, 2}, {2, 3, 4}}),
      MaySplit::kYes);
  EXPECT_EQ(
      ours(mesh_of({{0, 0, 0}, {1, 0, 0}, {0, 1, 0}, {2, 1, 0}, {1, 2, 0}}, {{0, 1, 2}, {2, 3, 4}}))
          ->vertices,
      6U);
}

TEST(OwnDraco, LeavesOutVerticesWithoutTriangles) {
  const mesh::Mesh mesh =
      mesh_of({{9, 9, 9}, {0, 0, 0}, {1, 0, 0}, {5, 5, 5}, {0, 1, 0}}, {{1, 2, 4}});
  EXPECT_EQ(ours(mesh)->vertices, 3U);
  expect_ours(mesh);
}

TEST(OwnDraco, EncodesVerticesOfManyTriangles) {
  std::vector<mesh::Vec3> positions = {{0, 0, 0}};
  std::vector<mesh::Triangle> triangles;
  constexpr std::uint32_t kSpokes = 500;
  for (std::uint32_t i = 0; i < kSpokes; ++i) {
    positions.push_back({static_cast<float>(i), static_cast<float>(i * i % 97), 1});
    triangles.push_back({0, 1 + i, 1 + (i + 1) % kSpokes});
  }
  expect_ours(mesh_of(positions, triangles));
  for (mesh::Triangle& triangle : triangles) {
    for (std::uint32_t& vertex : triangle) vertex = kSpokes - vertex;
  }
  expect_ours(mesh_of(positions, triangles));
}

TEST(OwnDraco, EncodesLongStrips) {
  std::vector<mesh::Vec3> positions = {{0, 0, 0}, {0, 1, 0}};
  std::vector<mesh::Triangle> triangles;
  constexpr std::uint32_t kTriangles = 20'000;
  for (std::uint32_t i = 0; i < kTriangles; ++i) {
    positions.push_back({static_cast<float>(i), static_cast<float>(i % 2), 0});
    triangles.push_back(i % 2 == 0 ? mesh::Triangle{i, i + 1, i + 2}
                                   : mesh::Triangle{i + 1, i, i + 2});
  }
  expect_ours(mesh_of(positions, triangles));
}

// Our encoder returns nothing for surfaces that it cannot write; libdraco encodes those.
TEST(OwnDraco, RefusesWhatItDoesNotCover) {
  const std::vector<mesh::Vec3> positions = {{0, 0, 0},  {1, 0, 0}, {0, 1, 0}, {0, 0, 1},
                                             {0, -1, 0}, {2, 2, 2}, {3, 2, 2}, {2, 3, 2}};
  const std::vector<std::pair<std::string, std::vector<mesh::Triangle>>> surfaces = {
      {"nothing", {}},
      {"three at an edge", {{0, 1, 2}, {1, 0, 3}, {1, 0, 4}}},
      {"two pairs of three at an edge",
       {{0, 1, 2}, {0, 1, 3}, {1, 0, 4}, {1, 0, 5}, {2, 3, 6}, {2, 3, 7}, {3, 2, 0}, {3, 2, 4}}},
      {"a repeated vertex", {{0, 1, 1}}},
      {"two closed fans at a vertex",
       {{0, 2, 1}, {0, 1, 3}, {1, 2, 3}, {2, 0, 3}, {0, 5, 6}, {0, 7, 5}, {5, 7, 6}, {7, 0, 6}}},
      {"a closed and an open fan at a vertex",
       {{0, 2, 1}, {0, 1, 3}, {1, 2, 3}, {2, 0, 3}, {0, 5, 6}}},
  };
  for (const auto& [name, triangles] : surfaces) {
    SCOPED_TRACE(name);
    const mesh::Mesh mesh = mesh_of(positions, triangles);
    EXPECT_FALSE(ours(mesh));
    if (triangles.empty()) continue;
    EXPECT_EQ(difference(test::encoded(mesh, MeshFormat::kDrc), mesh, kBits, MaySplit::kYes), "");
  }
}

TEST(OwnDraco, TakesNoLayersForOneLayer) {
  mesh::Mesh mesh = test::large_mesh();
  const auto layered = ours(mesh);
  mesh.layer_vertices.clear();
  mesh.layer_triangles.clear();
  const auto flat = ours(mesh);
  ASSERT_TRUE(layered && flat);
  EXPECT_TRUE(layered->bytes == flat->bytes);
  // Triangles that name vertices of other layers than theirs.
  mesh.layer_vertices = {0, mesh.positions.size() / 2, mesh.positions.size() / 2 + 1,
                         mesh.positions.size()};
  mesh.layer_triangles = {0, 10, 20, mesh.triangles.size()};
  EXPECT_FALSE(ours(mesh));
}

TEST(OwnDraco, IsTheSameToTheByteOnAnyNumberOfThreadsAndInUsedMemory) {
  const std::array meshes = {test::several_blocks(), test::large_mesh(), with_handles(9)};
  for (const std::size_t look_ahead : {std::size_t{0}, Encoder::kLeastToLookAhead}) {
    Encoder used(look_ahead);
    for (const mesh::Mesh& mesh : meshes) {
      const auto one =
          Encoder(look_ahead).encode(surface_of(mesh), grid_of(mesh, kBits), Threads::kOne, {});
      ASSERT_TRUE(one);
      EXPECT_EQ(difference(text_of(*one), mesh, kBits), "");
      for (const int threads : {1, 2, 3, 16}) {
        const test::ThreadCount count(threads);
        const auto many = used.encode(surface_of(mesh), grid_of(mesh, kBits), Threads::kAll, {});
        EXPECT_TRUE(many->bytes == one->bytes) << threads;
      }
    }
  }
}

TEST(OwnDraco, IsNoLargerThanLibdracosStreams) {
  const mesh::Mesh mesh = test::several_blocks();
  // One triangle that repeats a vertex is not covered, and speed 4 is libdraco's too.
  const std::size_t standard = test::encoded(mesh, MeshFormat::kDrc, {kBits, 7}).size();
  EXPECT_EQ(test::encoded(mesh, MeshFormat::kDrc, {kBits, 5}).size(), standard);
  EXPECT_EQ(test::encoded(mesh, MeshFormat::kDrc, {kBits, 9}).size(), standard);
  EXPECT_EQ(ours(mesh)->bytes.size(), standard);
  EXPECT_NE(test::encoded(mesh, MeshFormat::kDrc, {kBits, 4}).size(), standard);
}

TEST(OwnDraco, StopsWhenItIsCancelled) {
  std::stop_source stop;
  stop.request_stop();
  const mesh::Mesh mesh = test::large_mesh();
  EXPECT_EQ(test::code_thrown_by([&] {
              Encoder().encode(surface_of(mesh), grid_of(mesh, kBits), Threads::kAll,
                               {stop.get_token(), nullptr});
            }),
            ErrorCode::kCancelled);
}

TEST(OwnDraco, PositionsThatAreNoPlacesAreAnError) {
  for (const float bad :
       {std::numeric_limits<float>::quiet_NaN(), std::numeric_limits<float>::infinity(), 3e38F}) {
    const mesh::Mesh mesh = mesh_of({{0, 0, 0}, {bad, 1, 0}, {-bad, 1, 0}}, {{0, 1, 2}});
    for (const MeshFormat format : {MeshFormat::kDrc, MeshFormat::kGlb}) {
      EXPECT_EQ(test::code_thrown_by([&] { test::encoded(mesh, format); }),
                ErrorCode::kUnusableVolume);
    }
  }
}

// As one that runs out of memory: a helper waits for no more items.
TEST(DracoChunks, EndTheirHelpersWhenTheProducerFails) {
  Chunks chunks;
  std::atomic<std::uint32_t> worked = 0;
  const auto work = [&](std::uint32_t begin, std::uint32_t end) { worked += end - begin; };
  const std::jthread helper([&] { chunks.help(work); });
  const auto fail = [](const auto& bring) {
    bring(5000);
    throw std::bad_alloc();
  };
  EXPECT_THROW(chunks.produce(work, fail), std::bad_alloc);
}

// Draco's decoder refuses streams with more than four faces for three symbols.
TEST(OwnDraco, LeavesTrianglesBackToBackToLibdraco) {
  for (const std::uint32_t pairs : {1U, 2U, 5U, 50U}) {
    SCOPED_TRACE(pairs);
    std::vector<mesh::Vec3> positions;
    std::vector<mesh::Triangle> triangles;
    for (std::uint32_t n = 0; n < pairs; ++n) {
      const auto x = static_cast<float>(2 * n);
      positions.insert(positions.end(), {{x, 0, 0}, {x + 1, 0, 0}, {x, 1, 1}});
      triangles.push_back({3 * n, 3 * n + 1, 3 * n + 2});
      triangles.push_back({3 * n, 3 * n + 2, 3 * n + 1});
    }
    const mesh::Mesh mesh = mesh_of(positions, triangles);
    EXPECT_FALSE(ours(mesh));
    EXPECT_EQ(decode_in_process(test::encoded(mesh, MeshFormat::kDrc)).triangles.size(), 2 * pairs);
    std::size_t in_glb = 0;
    for (const auto& primitive : test::read_with_node(test::encoded(mesh, MeshFormat::kGlb))) {
      in_glb += primitive.mesh.triangles.size();
    }
    EXPECT_EQ(in_glb, 2 * pairs);
  }
}

// Whatever comes: the right triangles, by whoever encodes them.
TEST(OwnDraco, WhateverComesDecodes) {
  Encoder encoder(0);
  std::size_t covered = 0;
  for (std::uint64_t seed = 0; seed < 500; ++seed) {
    SCOPED_TRACE(seed);
    const test::MadeUpMesh made = test::mesh_from_bytes(test::random_bytes(seed, 6000));
    if (!made.is_finite) {
      EXPECT_EQ(test::code_thrown_by([&] { test::encoded(made.mesh, MeshFormat::kDrc); }),
                ErrorCode::kUnusableVolume);
      continue;
    }
    if (made.mesh.triangles.size() == 0) continue;
    const int bits = made.draco.position_bits;
    const std::string drc = test::encoded(made.mesh, MeshFormat::kDrc, made.draco);
    EXPECT_EQ(difference(drc, made.mesh, bits, MaySplit::kYes), "");
    const auto encoded =
        encoder.encode(surface_of(made.mesh), grid_of(made.mesh, bits), Threads::kAll, {});
    if (!encoded) {
      // Only layers that are none keep a manifold from it.
      EXPECT_TRUE(!made.is_manifold || bits > 16 || made.has_wrong_layers);
      continue;
    }
    ++covered;
    EXPECT_EQ(difference(text_of(*encoded), made.mesh, bits,
                         made.is_manifold ? MaySplit::kNo : MaySplit::kYes),
              "");
  }
  EXPECT_GT(covered, 230U);
}

}  // namespace
}  // namespace isomesh::codec::edgebreaker
