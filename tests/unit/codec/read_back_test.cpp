// Files of one surface and of labels, read back by what measures them.
#include <algorithm>
#include <map>
#include <set>
#include <span>
#include <stop_token>
#include <string>
#include <vector>

#include <gtest/gtest.h>

#include "server/codec/decode/decode.h"
#include "server/codec/encode.h"
#include "server/mesh/label_surface.h"
#include "tests/support/errors.h"
#include "tests/support/kernels.h"
#include "tests/unit/codec/label_files.h"
#include "tests/unit/codec/meshes.h"
#include "tests/unit/codec/same_mesh.h"

namespace isomesh::codec {
namespace {

using test::encoded;

DecodedSurface decoded(const std::string& file, MeshFormat format,
                       const mesh::Context& context = {}) {
  return decode(std::as_bytes(std::span(file)), format, space_of(format, {}), context);
}

test::DecodedMesh to_test(const DecodedSurface& surface) {
  return {{surface.positions.begin(), surface.positions.end()},
          {surface.triangles.begin(), surface.triangles.end()}};
}

using Corners = std::array<mesh::Vec3, 3>;

std::vector<Corners> corners_of(const mesh::SurfaceView& surface) {
  std::vector<Corners> result;
  for (const auto& [a, b, c] : surface.triangles) {
    result.push_back({surface.positions[a], surface.positions[b], surface.positions[c]});
  }
  return result;
}

void expect_read_back(const mesh::Mesh& mesh, MeshFormat format) {
  const DecodedSurface surface = decoded(encoded(mesh, format), format);
  if (format == MeshFormat::kDrc || format == MeshFormat::kGlb) {
    test::expect_same_mesh(test::welded({to_test(surface)}), mesh, DracoParameters{}.position_bits);
    return;
  }
  EXPECT_EQ(surface.positions.size(), mesh.positions.size());
  EXPECT_TRUE(corners_of(surface.view()) == corners_of(mesh));
  if (format != MeshFormat::kStl) {
    EXPECT_TRUE(std::ranges::equal(surface.positions, mesh.positions));
  }
}

class ReadBack : public testing::TestWithParam<MeshFormat> {};

TEST_P(ReadBack, HasTheSameTrianglesInTheSamePlaces) {
  for (const auto& [name, mesh] : test::meshes_to_encode()) {
    SCOPED_TRACE(name);
    expect_read_back(mesh, GetParam());
  }
}

TEST_P(ReadBack, OfManyBlocksIsOneWhole) {
  expect_read_back(test::several_blocks(), GetParam());
  expect_read_back(test::large_mesh(), GetParam());
}

TEST_P(ReadBack, OfAnEmptySurfaceIsEmpty) {
  const DecodedSurface surface = decoded(encoded(mesh::Mesh{}, GetParam()), GetParam());
  EXPECT_EQ(surface.positions.size(), 0U);
  EXPECT_EQ(surface.triangles.size(), 0U);
}

TEST_P(ReadBack, IsTheSameOnAnyNumberOfThreads) {
  const std::string file = encoded(test::large_mesh(), GetParam());
  const DecodedSurface first = decoded(file, GetParam());
  for (const int threads : {1, 3, 16}) {
    const test::ThreadCount count(threads);
    const DecodedSurface again = decoded(file, GetParam());
    EXPECT_TRUE(std::ranges::equal(again.positions, first.positions)) << threads;
    EXPECT_TRUE(std::ranges::equal(again.triangles, first.triangles)) << threads;
  }
}

// Where a file ends too soon it is refused, or, of text that ends at a line's end, read as shorter.
TEST_P(ReadBack, OfAFileThatEndsTooSoonIsRefused) {
  const auto meshes = test::meshes_to_encode();
  const mesh::Mesh& mesh = meshes.at(2).mesh;
  const std::string file = encoded(mesh, GetParam());
  const std::size_t step = std::max<std::size_t>(1, file.size() / 500);
  std::size_t refused = 0;
  std::size_t cuts = 0;
  for (std::size_t bytes = 0; bytes < file.size(); bytes += step, ++cuts) {
    try {
      const DecodedSurface surface = decoded(file.substr(0, bytes), GetParam());
      EXPECT_LT(surface.triangles.size(), mesh.triangles.size()) << bytes;
      EXPECT_EQ(GetParam(), MeshFormat::kObj) << bytes;
    } catch (const Error& error) {
      EXPECT_EQ(error.code(), ErrorCode::kInternal) << error.what();
      EXPECT_NE(std::string(error.what()).find(to_string(GetParam())), std::string::npos)
          << error.what();
      ++refused;
    }
  }
  EXPECT_GT(refused, GetParam() == MeshFormat::kObj ? cuts / 4 : cuts - 1);
}

TEST_P(ReadBack, OfWrongBytesIsRefusedOrReadButNeverWorse) {
  const std::string file = encoded(test::meshes_to_encode().at(2).mesh, GetParam());
  const std::size_t step = std::max<std::size_t>(1, file.size() / 300);
  for (std::size_t at = 0; at < file.size(); at += step) {
    std::string wrong = file;
    wrong[at] = static_cast<char>(wrong[at] ^ 0x55);
    try {
      const DecodedSurface surface = decoded(wrong, GetParam());
      for (const mesh::Triangle& triangle : surface.triangles) {
        EXPECT_LT(*std::ranges::max_element(triangle), surface.positions.size());
      }
    } catch (const Error& error) {
      EXPECT_EQ(error.code(), ErrorCode::kInternal) << error.what();
    }
  }
}

TEST_P(ReadBack, EndsWhenItIsCancelled) {
  const std::string file = encoded(test::large_mesh(), GetParam());
  std::stop_source stop;
  stop.request_stop();
  EXPECT_EQ(test::code_thrown_by([&] {
              decoded(file, GetParam(), {stop.get_token(), nullptr});
            }),
            ErrorCode::kCancelled);
}

INSTANTIATE_TEST_SUITE_P(Formats, ReadBack, testing::ValuesIn(test::formats_of_a_surface()),
                         [](const auto& test) { return std::string(to_string(test.param)); });

TEST(ReadBackStl, MakesCornersAtOnePlaceOneVertexWhateverTheSignOfZero) {
  const mesh::Mesh mesh =
      test::mesh_of({{0, 0, 0}, {1, 0, 0}, {0, 1, 0}, {-0.0F, 0, -0.0F}, {0, 1, 0}, {0, 0, 1}},
                    {{0, 1, 2}, {4, 5, 3}});
  const DecodedSurface surface = decoded(encoded(mesh, MeshFormat::kStl), MeshFormat::kStl);
  EXPECT_EQ(surface.positions.size(), 4U);
  EXPECT_EQ(surface.triangles[0], (mesh::Triangle{0, 1, 2}));
  EXPECT_EQ(surface.triangles[1], (mesh::Triangle{2, 3, 0}));
}

TEST(ReadBackStl, RefusesPositionsThatAreNoNumbers) {
  const float infinite = std::numeric_limits<float>::infinity();
  const mesh::Mesh mesh = test::mesh_of({{0, 0, 0}, {1, 0, 0}, {0, infinite, 0}}, {{0, 1, 2}});
  const auto error =
      test::thrown_by([&] { decoded(encoded(mesh, MeshFormat::kStl), MeshFormat::kStl); });
  ASSERT_TRUE(error.has_value());
  EXPECT_EQ(error->code(), ErrorCode::kInternal);
  EXPECT_NE(std::string(error->what()).find("finite"), std::string::npos) << error->what();
}

TEST(ReadBackGlb, RefusesAnotherSpace) {
  std::string glb = encoded(test::meshes_to_encode().at(2).mesh, MeshFormat::kGlb);
  const std::size_t at = glb.find("\"scale\":[0.001");
  ASSERT_NE(at, std::string::npos);
  glb[at + 13] = '2';
  const auto error = test::thrown_by([&] { decoded(glb, MeshFormat::kGlb); });
  ASSERT_TRUE(error.has_value());
  EXPECT_NE(std::string(error->what()).find("LPS"), std::string::npos) << error->what();
}

// With the places of each label's own surface, as many times as it has them.
using Triangles = std::multiset<Corners>;

class ReadBackLabels : public test::LabelFilesTest {
 protected:
  Triangles labels_triangles() const {
    Triangles triangles;
    for (std::size_t n = 1; n <= kLabels; ++n) {
      mesh::Mesh mesh;
      extract_label(walls_, *triangles_, n, mesh);
      for (const Corners& corners : corners_of(mesh)) triangles.insert(corners);
    }
    return triangles;
  }

  static Triangles triangles_of(const DecodedSurface& surface) {
    const auto corners = corners_of(surface.view());
    return {corners.begin(), corners.end()};
  }
};

// By where a triangle begins, which is up to the encoder of labels.
Triangles turned(const Triangles& triangles) {
  Triangles result;
  for (Corners corners : triangles) {
    std::rotate(corners.begin(), std::ranges::min_element(corners), corners.end());
    result.insert(corners);
  }
  return result;
}

TEST_F(ReadBackLabels, FilesOfAllLabelsHaveEachLabelsTriangles) {
  const Triangles expected = turned(labels_triangles());
  for (const MeshFormat format :
       {MeshFormat::kPly, MeshFormat::kObj, MeshFormat::k3mf, MeshFormat::kVtk, MeshFormat::kVtp}) {
    SCOPED_TRACE(to_string(format));
    EXPECT_TRUE(turned(triangles_of(decoded(encoded(format), format))) == expected);
  }
  const DecodedSurface glb = decoded(encoded(MeshFormat::kGlb), MeshFormat::kGlb);
  EXPECT_EQ(glb.triangles.size(), expected.size());
  // Each of two labels has the corners of their wall, which is there once before encoding.
  EXPECT_GT(glb.positions.size(), walls_.mesh.positions.size());
}

TEST_F(ReadBackLabels, AZipIsReadFileByFile) {
  const std::string zip = zipped({MeshFormat::kStl, MeshFormat::kPly, MeshFormat::kDrc}).bytes;
  const auto surfaces = decode_zip(std::as_bytes(std::span(zip)), Space::kLps, {});
  ASSERT_EQ(surfaces.size(), 3U);
  const Triangles expected = turned(labels_triangles());
  EXPECT_TRUE(turned(triangles_of(surfaces.at(MeshFormat::kStl))) == expected);
  EXPECT_TRUE(turned(triangles_of(surfaces.at(MeshFormat::kPly))) == expected);
  EXPECT_EQ(surfaces.at(MeshFormat::kDrc).triangles.size(), expected.size());
  EXPECT_EQ(decoded(zip, MeshFormat::kZip).triangles.size(), 3 * expected.size());
}

TEST_F(ReadBackLabels, AZipWithAWrongFileIsRefused) {
  std::string zip = zipped({MeshFormat::kStl}).bytes;
  zip[1000] = static_cast<char>(zip[1000] ^ 1);
  EXPECT_EQ(test::code_thrown_by([&] { decoded(zip, MeshFormat::kZip); }), ErrorCode::kInternal)
      << "its sum is not looked at";
}

}  // namespace
}  // namespace isomesh::codec
