// Files that are written while a surface is walked through.
#include <algorithm>
#include <array>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include <gtest/gtest.h>

#include "server/codec/draco/grid.h"
#include "server/codec/draco_chunk.h"
#include "server/codec/formats.h"
#include "server/codec/walked_file.h"
#include "server/mesh/extract/windows.h"
#include "tests/support/errors.h"
#include "tests/support/kernels.h"
#include "tests/support/memory_spool.h"
#include "tests/unit/codec/meshes.h"

namespace isomesh::codec {
namespace {

using test::means;
using Bytes = test::SampleVolume<std::uint8_t>;

constexpr std::uint64_t kAll32 = std::uint64_t{1} << 32;

// The user of a walk for one file.
class OneFile : public mesh::WindowUser {
 public:
  explicit OneFile(WalkedFile& file) : file_(file) {}

  void see_extracted(const mesh::Mesh& /*mesh*/, std::size_t /*begin*/,
                     std::size_t /*end*/) override {}
  std::size_t begin(const mesh::Window& window) override {
    file_.see(window);
    return file_.parts(window);
  }
  InOrder work(const mesh::Window& window, std::size_t part) override {
    return file_.work(window, part);
  }

 private:
  WalkedFile& file_;
};

// Layers behind so many vertices, as if others came before them.
class Behind : public mesh::LayerSource {
 public:
  Behind(mesh::LayerSource& layers, std::uint64_t vertices) : layers_(layers) {
    count_.layer_vertices = layers.count().layer_vertices;
    count_.layer_triangles = layers.count().layer_triangles;
    for (std::uint64_t& sum : count_.layer_vertices) sum += vertices;
  }

  const mesh::SurfaceCount& count() const override { return count_; }
  void write(std::uint32_t begin, std::uint32_t end, mesh::Mesh& mesh) override {
    layers_.write(begin, end, mesh);
  }
  void forget(std::uint32_t begin, std::uint32_t end) override { layers_.forget(begin, end); }

 private:
  mesh::LayerSource& layers_;
  mesh::SurfaceCount count_;
};

struct Case {
  const Bytes& volume;
  mesh::ExtractOptions extract;
  mesh::SmoothOptions smooth;
  MeshParameters parameters = {};
  std::size_t triangles_per_block = 300;
  mesh::Spool* spool = nullptr;
  float shrunk = 0;          // by how much less than the surface's is the expected box
  std::uint64_t behind = 0;  // so many vertices
  int walks = 0;
};

mesh::Mesh whole(const Case& one) {
  mesh::Mesh mesh = test::extracted(one.volume, one.extract);
  smooth(one.smooth, {}, mesh);
  return mesh;
}

std::string walked(Case& one, MeshFormat format) {
  const mesh::Topology topology = measure_topology(whole(one), {});
  const auto lattice = one.volume.lattice();
  Provenance provenance;
  provenance.parameters = one.parameters;
  std::string bytes;
  const Sink sink = [&](std::span<const std::byte> piece) {
    bytes.append(reinterpret_cast<const char*>(piece.data()), piece.size());
  };
  std::unique_ptr<WalkedFile> file;
  do {
    mesh::SurfaceWindows windows(lattice, one.extract, {}, one.spool);
    Behind source(windows, one.behind);
    const mesh::SurfaceSize size = size_of(source.count());
    const BlockCut cut(size.triangles, size.layers, one.triangles_per_block);
    if (!file) {
      mesh::Reach reach = windows.reach();
      for (float& low : reach.low) low += one.shrunk;
      for (float& high : reach.high) high -= one.shrunk;
      file = walked_file(
          {provenance, format, size, reach, sink, one.spool, {}, one.triangles_per_block});
    }
    OneFile user(*file);
    walk(source, {one.smooth, static_cast<std::uint32_t>(cut.depth), true}, {}, user);
    ++one.walks;
  } while (!file->end(topology));
  return bytes;
}

// Tells how many layers have been asked for.
class Watched : public mesh::LayerSource {
 public:
  explicit Watched(mesh::LayerSource& layers) : layers_(layers) {}

  const mesh::SurfaceCount& count() const override { return layers_.count(); }
  void write(std::uint32_t begin, std::uint32_t end, mesh::Mesh& mesh) override {
    written_ = std::max(written_, end);
    layers_.write(begin, end, mesh);
  }
  void forget(std::uint32_t begin, std::uint32_t end) override { layers_.forget(begin, end); }

  std::uint32_t written() const { return written_; }

 private:
  mesh::LayerSource& layers_;
  std::uint32_t written_ = 0;
};

// The triangles by the places of their corners, of which some may be equal.
using Corners = std::array<mesh::Vec3, 3>;
std::vector<Corners> triangles_in(const std::string& glb) {
  const DecodedSurface surface =
      decode(std::as_bytes(std::span(glb)), MeshFormat::kGlb, Space::kLps, {});
  std::vector<Corners> triangles;
  for (const auto& [a, b, c] : surface.triangles) {
    const auto from = [&](std::uint32_t first, std::uint32_t second, std::uint32_t third) {
      return Corners{surface.positions[first], surface.positions[second], surface.positions[third]};
    };
    triangles.push_back(std::min({from(a, b, c), from(b, c, a), from(c, a, b)}));
  }
  std::ranges::sort(triangles);
  return triangles;
}

std::string encoded_whole(const Case& one, const mesh::Mesh& mesh) {
  Provenance provenance;
  provenance.parameters = one.parameters;
  return test::encoded(mesh, MeshFormat::kGlb, provenance);
}

// Empty layers at both ends and in the middle.
Bytes balls() {
  const test::Field low = test::sphere({6.2, 6.8, 8.1}, 4.3);
  const test::Field high = test::sphere({7.1, 6.2, 23.3}, 4.9);
  return test::sample<std::uint8_t>(
      [=](const test::Point& at) { return 100 + 20 * std::max(low(at), high(at)); }, {14, 14, 32});
}

std::vector<Bytes> volumes() {
  return {
      balls(), test::noise<std::uint8_t>({0, 1, 60, 61, 200}, {11, 9, 37}, 31),
      test::noise<std::uint8_t>({0, 60, 90}, {9, 12, 21}, 5, test::oblique_left_handed_geometry()),
      test::constant<std::uint8_t>(0, {5, 5, 9})};
}

TEST(WalkedGlb, HasTheGeometryOfTheWholeSurface) {
  constexpr std::array kCodecs = {GlbCodec::kDraco, GlbCodec::kMeshopt, GlbCodec::kQuantized};
  const std::vector<mesh::SmoothOptions> smoothings = {
      {}, {.steps = means(5, {1})}, {.steps = means(4, {0.33, -0.34})}};
  std::size_t number = 0;
  for (const Bytes& volume : volumes()) {
    for (const Scheme scheme : test::kSchemes) {
      for (const bool regularize : {false, true, false, true}) {
        ++number;
        const mesh::SmoothOptions& smoothing = smoothings[number / 2 % 3];
        SCOPED_TRACE(testing::Message()
                     << "case " << number << ", scheme " << static_cast<int>(scheme)
                     << ", regularised " << regularize << ", steps " << smoothing.steps.size());
        test::MemorySpool spool;
        Case one = {
            volume,
            {.iso = 60, .scheme = scheme, .close = number % 5 > 2, .regularize = regularize},
            smoothing};
        one.parameters.glb_codec = kCodecs[number % 3];
        one.parameters.normals = number % 7 > 0;
        if (number % 4 > 0) one.spool = &spool;
        const test::ThreadCount threads(number % 3 == 0 ? 3 : 1);
        const std::string file = walked(one, MeshFormat::kGlb);
        EXPECT_EQ(one.walks, 1);
        EXPECT_TRUE(triangles_in(file) == triangles_in(encoded_whole(one, whole(one))));
      }
    }
  }
}

TEST(WalkedGlb, HasTheBytesOfTheWholeSurface) {
  const Bytes volume = test::noise<std::uint8_t>({0, 1, 2, 9}, {50, 50, 40}, 9);
  for (const GlbCodec codec : {GlbCodec::kDraco, GlbCodec::kMeshopt}) {
    test::MemorySpool spool;
    Case one = {volume, {.iso = 1, .regularize = true}, {.steps = means(2, {1})}};
    one.parameters.glb_codec = codec;
    one.triangles_per_block = kTrianglesPerBlock;
    one.spool = &spool;
    const mesh::Mesh mesh = whole(one);
    ASSERT_GT(cut_blocks(mesh, kTrianglesPerBlock).size(), 1U);
    EXPECT_TRUE(walked(one, MeshFormat::kGlb) == encoded_whole(one, mesh));
  }
}

// As a whole, and with the spool and without.
TEST(WalkedGlb, HasTheBytesOfTheWholeSurfaceIfItIsPlain) {
  for (const Bytes& volume : volumes()) {
    for (const bool close : {false, true}) {
      for (const bool normals : {false, true}) {
        for (const int threads : {1, 3}) {
          const test::ThreadCount several(threads);
          test::MemorySpool spool;
          Case one = {
              volume, {.iso = 60, .close = close, .regularize = true}, {.steps = means(5, {1})}};
          one.parameters.glb_codec = GlbCodec::kNone;
          one.parameters.normals = normals;
          if (threads == 3) one.spool = &spool;
          EXPECT_TRUE(walked(one, MeshFormat::kGlb) == encoded_whole(one, whole(one)));
          EXPECT_EQ(one.walks, 1);
        }
      }
    }
  }
}

// A vertex outside of what was expected: the windows come again.
TEST(WalkedGlb, TakesTheBoxOfTheSurfaceIfThatIsNotTheExpectedOne) {
  const Bytes volume = balls();
  test::MemorySpool spool;
  Case one = {volume, {.iso = 60, .regularize = true}, {.steps = means(5, {1})}};
  one.spool = &spool;
  one.shrunk = 3;
  const auto triangles = triangles_in(walked(one, MeshFormat::kGlb));
  EXPECT_EQ(one.walks, 2);
  mesh::Mesh mesh = whole(one);
  mesh.reach = {};
  EXPECT_TRUE(triangles == triangles_in(encoded_whole(one, mesh)));
}

// The head when the surface has been counted, and triangles with the first windows.
TEST(WalkedStl, BeginsLongBeforeTheLastLayer) {
  const Bytes volume = test::noise<std::uint8_t>({0, 1, 60, 61, 200}, {8, 8, 80}, 31);
  const test::ThreadCount one(1);
  const auto lattice = volume.lattice();
  mesh::SurfaceWindows windows(lattice, {.iso = 60, .regularize = true}, {});
  Watched watched(windows);
  std::vector<std::uint32_t> layers;  // asked for before each piece
  const Sink sink = [&](std::span<const std::byte> /*piece*/) {
    layers.push_back(watched.written());
  };
  const Provenance provenance;
  const auto file = walked_file(
      {provenance, MeshFormat::kStl, size_of(watched.count()), windows.reach(), sink, nullptr, {}});
  ASSERT_EQ(layers.size(), 1U) << "the head was not sent";
  EXPECT_EQ(layers.front(), 0U);
  OneFile user(*file);
  walk(watched, {{.steps = means(5, {1})}, 4, false}, {}, user);
  ASSERT_GT(layers.size(), 10U);
  EXPECT_LT(layers[1], watched.layers() / 2);
  EXPECT_EQ(layers.back(), watched.layers());
}

// Only numbers of one window have to fit 32 bits.
TEST(WalkedFile, TakesMoreVerticesThanHave32Bits) {
  const Bytes volume = balls();
  Case one = {volume, {.iso = 60, .regularize = true}, {.steps = means(5, {1})}};
  one.parameters.glb_codec = GlbCodec::kMeshopt;
  for (const MeshFormat format : {MeshFormat::kStl, MeshFormat::kGlb}) {
    one.behind = 0;
    const std::string bytes = walked(one, format);
    for (const std::uint64_t behind : {kAll32 - 100, kAll32, 3 * kAll32}) {
      one.behind = behind;
      EXPECT_TRUE(walked(one, format) == bytes);
    }
  }
  one.parameters.glb_codec = GlbCodec::kNone;
  EXPECT_EQ(test::code_thrown_by([&] { walked(one, MeshFormat::kGlb); }), ErrorCode::kTooLarge);
}

TEST(WalkedGlb, SaysThatTheSpoolIsFull) {
  const Bytes volume = balls();
  test::MemorySpool spool(3000);
  Case one = {volume, {.iso = 60}, {}};
  one.spool = &spool;
  EXPECT_EQ(test::code_thrown_by([&] { walked(one, MeshFormat::kGlb); }), ErrorCode::kOutOfSpace);
}

TEST(Reach, HoldsTheSurfaceAndIsNotMuchWider) {
  for (const Scheme scheme : test::kSchemes) {
    for (const bool close : {false, true}) {
      for (const bool regularize : {false, true}) {
        for (const auto& geometry : {Geometry{}, test::oblique_left_handed_geometry()}) {
          Bytes volume = balls();
          volume.geometry = geometry;
          const mesh::Mesh mesh = test::extracted(
              volume, {.iso = 60, .scheme = scheme, .close = close, .regularize = regularize});
          const mesh::Reach box = box_of(mesh.positions.span());
          ASSERT_TRUE(mesh.reach.holds(box));
          const double step = std::ranges::max(geometry.spacing);
          for (std::size_t axis = 0; axis < 3; ++axis) {
            EXPECT_GE(box.low[axis] - mesh.reach.low[axis], 0.5F);
            EXPECT_LE(mesh.reach.high[axis] - mesh.reach.low[axis],
                      box.high[axis] - box.low[axis] + 9 * step);
          }
        }
      }
    }
  }
}

// A surface that is cut into many blocks needs no deeper windows when it has more layers.
TEST(BlockCut, IsAtMostSoDeep) {
  for (const std::uint64_t layers : {64U, 512U, 1024U, 8192U}) {
    for (const std::uint64_t of_layer : {1000U, 20'000U, 61'500U, 250'000U}) {
      const BlockCut cut(of_layer * layers, layers, kTrianglesPerBlock);
      if (cut.parts > 1) {
        EXPECT_LE(cut.depth, BlockCut::kMostLayers);
      }
      const double block = static_cast<double>(of_layer * cut.depth) / cut.parts;
      EXPECT_GT(block, 0.5 * kTrianglesPerBlock);
      EXPECT_LT(block, 2.0 * kTrianglesPerBlock);
    }
  }
}

}  // namespace
}  // namespace isomesh::codec
