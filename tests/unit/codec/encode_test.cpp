#include <algorithm>
#include <array>
#include <span>
#include <stop_token>
#include <string>

#include <gtest/gtest.h>

#include "server/codec/formats.h"
#include "tests/support/any_threads.h"
#include "tests/support/errors.h"
#include "tests/support/kernels.h"
#include "tests/unit/codec/meshes.h"

namespace isomesh::codec {
namespace {

TEST(Encode, WritesEveryFormatOfEveryMesh) {
  for (const MeshFormat format : test::formats_of_a_surface()) {
    SCOPED_TRACE(to_string(format));
    EXPECT_FALSE(test::encoded(mesh::Mesh{}, format).empty());
  }
}

// The formats that are written as they go.
class EncodeInBlocks : public testing::TestWithParam<MeshFormat> {
 protected:
  static void encode_to(const mesh::Context& context, const Sink& sink) {
    encode(test::large_mesh(), GetParam(), {}, context, sink);
  }
};

TEST_P(EncodeInBlocks, IsTheSameOnAnyNumberOfThreads) {
  test::expect_same_on_any_threads([] { return test::encoded(test::large_mesh(), GetParam()); });
}

TEST_P(EncodeInBlocks, HandsOverPiecesWhileProgressGrowsToOne) {
  double last = 0;
  int calls = 0;
  const auto note = [&](double done) {
    EXPECT_GT(done, last);
    last = done;
    ++calls;
  };
  std::size_t largest = 0;
  encode_to({{}, note}, [&](auto piece) { largest = std::max(largest, piece.size()); });
  EXPECT_EQ(last, 1);
  EXPECT_GT(calls, 2);
  EXPECT_LT(largest, 1U << 20);
}

TEST_P(EncodeInBlocks, StopsOnceItIsCancelled) {
  std::stop_source source;
  std::size_t bytes = 0;
  const auto stop_soon = [&](std::span<const std::byte> piece) {
    bytes += piece.size();
    source.request_stop();
  };
  EXPECT_EQ(test::code_thrown_by([&] {
              encode_to({source.get_token(), {}}, stop_soon);
            }),
            ErrorCode::kCancelled);
  EXPECT_LT(bytes, 10'000U);  // a head, or a block
}

TEST_P(EncodeInBlocks, PassesOnWhatItsSinkThrows) {
  const auto full = [](std::span<const std::byte>) {
    throw Error(ErrorCode::kOutOfSpace, "no space");
  };
  EXPECT_EQ(test::code_thrown_by([&] { encode_to({}, full); }), ErrorCode::kOutOfSpace);
}

INSTANTIATE_TEST_SUITE_P(Formats, EncodeInBlocks, testing::ValuesIn(test::exact_formats()),
                         [](const auto& test) { return std::string(to_string(test.param)); });

TEST(Formats, EveryOneHasItsRow) {
  const mesh::SurfaceSize surface = {2'000'000, 1'000'000};
  for (const MeshFormat format : test::formats_of_a_surface()) {
    const Format& row = describe(format);
    EXPECT_EQ(row.format, format);
    EXPECT_NE(row.media_type.find('/'), std::string_view::npos) << to_string(format);
    EXPECT_GT(row.milliseconds_per_triangle, 0) << to_string(format);
    EXPECT_GT(row.bytes(surface, {}), 1'000'000) << to_string(format);
  }
}

TEST(Formats, TellTheSizeOfWhatTheyEncode) {
  const mesh::Mesh& mesh = test::large_mesh();
  const mesh::SurfaceSize surface = {mesh.triangles.size(), mesh.positions.size()};
  for (const MeshFormat format : test::formats_of_a_surface()) {
    const auto bytes = static_cast<double>(test::encoded(mesh, format).size());
    EXPECT_LT(describe(format).bytes(surface, {}), 3 * bytes) << to_string(format);
    EXPECT_GT(3 * describe(format).bytes(surface, {}), bytes) << to_string(format);
    if (!describe(format).has_exact_bytes({})) continue;
    constexpr double kHeader = 4000;
    EXPECT_NEAR(describe(format).bytes(surface, {}), bytes, kHeader) << to_string(format);
  }
}

TEST(Formats, NormalsAndBitsMakeDracoLarger) {
  const mesh::SurfaceSize surface = {2'000'000, 1'000'000};
  MeshParameters less;
  less.normals = false;
  MeshParameters more;
  more.normals = true;
  more.draco.position_bits = 20;
  for (const MeshFormat format : {MeshFormat::kDrc, MeshFormat::kGlb}) {
    EXPECT_GT(describe(format).bytes(surface, more), describe(format).bytes(surface, less));
  }
  const Format& glb = describe(MeshFormat::kGlb);
  EXPECT_GT(glb.memory_bytes(surface, more), glb.memory_bytes(surface, less));
}

TEST(Formats, HaveTheMediaTypesThatAreRegistered) {
  const auto media_type = [](MeshFormat format) { return describe(format).media_type; };
  EXPECT_EQ(media_type(MeshFormat::kGlb), "model/gltf-binary");
  EXPECT_EQ(media_type(MeshFormat::kStl), "model/stl");
  EXPECT_EQ(media_type(MeshFormat::kObj), "model/obj");
  EXPECT_EQ(media_type(MeshFormat::kDrc), "application/octet-stream");
  EXPECT_EQ(media_type(MeshFormat::kPly), "application/octet-stream");
  EXPECT_EQ(media_type(MeshFormat::k3mf), "model/3mf");
  EXPECT_EQ(media_type(MeshFormat::kUsda), "model/vnd.usda");
  EXPECT_EQ(media_type(MeshFormat::kUsdz), "model/vnd.usdz+zip");
  EXPECT_EQ(media_type(MeshFormat::kZip), "application/zip");
}

}  // namespace
}  // namespace isomesh::codec
