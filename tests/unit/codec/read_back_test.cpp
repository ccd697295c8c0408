// Files that round coordinates, read back by what measures them.
#include <algorithm>
#include <array>
#include <cctype>
#include <cstring>
#include <span>
#include <stop_token>
#include <string>
#include <vector>

#include <gtest/gtest.h>

#include "server/codec/formats.h"
#include "tests/support/any_threads.h"
#include "tests/support/errors.h"
#include "tests/support/kernels.h"
#include "tests/unit/codec/glb_container.h"
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

// A format, and the codec if it is GLB.
struct Kind {
  MeshFormat format = MeshFormat::kDrc;
  GlbCodec codec = GlbCodec::kDraco;
};

std::string encoded_as(const mesh::Mesh& mesh, const Kind& kind) {
  Provenance provenance;
  provenance.parameters.glb_codec = kind.codec;
  return encoded(mesh, kind.format, provenance);
}

void expect_read_back(const mesh::Mesh& mesh, const Kind& kind) {
  const DecodedSurface surface = decoded(encoded_as(mesh, kind), kind.format);
  test::expect_same_mesh(test::welded({to_test(surface)}), mesh, DracoParameters{}.position_bits);
}

void expect_refused_or_read(const std::string& file, MeshFormat format) {
  try {
    const DecodedSurface surface = decoded(file, format);
    for (const mesh::Triangle& triangle : surface.triangles) {
      EXPECT_LT(*std::ranges::max_element(triangle), surface.positions.size());
    }
  } catch (const Error& error) {
    EXPECT_EQ(error.code(), ErrorCode::kInternal) << error.what();
  }
}

class ReadBack : public testing::TestWithParam<Kind> {
 protected:
  static std::string file_of(const mesh::Mesh& mesh) { return encoded_as(mesh, GetParam()); }
  static DecodedSurface read(const std::string& file, const mesh::Context& context = {}) {
    return decoded(file, GetParam().format, context);
  }
};

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
  const DecodedSurface surface = read(file_of(mesh::Mesh{}));
  EXPECT_EQ(surface.positions.size(), 0U);
  EXPECT_EQ(surface.triangles.size(), 0U);
}

TEST_P(ReadBack, IsTheSameOnAnyNumberOfThreads) {
  const std::string file = file_of(test::large_mesh());
  test::expect_same_on_any_threads([&] { return read(file); },
                                   [](const DecodedSurface& a, const DecodedSurface& b) {
                                     return std::ranges::equal(a.positions, b.positions) &&
                                            std::ranges::equal(a.triangles, b.triangles);
                                   });
}

TEST_P(ReadBack, OfAFileThatEndsTooSoonIsRefused) {
  const std::string file = file_of(test::meshes_to_encode().at(2).mesh);
  const std::size_t step = std::max<std::size_t>(1, file.size() / 500);
  for (std::size_t bytes = 0; bytes < file.size(); bytes += step) {
    const auto error = test::thrown_by([&] { read(file.substr(0, bytes)); });
    ASSERT_TRUE(error.has_value()) << bytes;
    EXPECT_EQ(error->code(), ErrorCode::kInternal) << error->what();
    const std::string named = std::string(to_string(GetParam().format)) + " file";
    EXPECT_NE(std::string(error->what()).find(named), std::string::npos) << error->what();
  }
}

TEST_P(ReadBack, OfWrongBytesIsRefusedOrReadButNeverWorse) {
  const std::string file = file_of(test::meshes_to_encode().at(2).mesh);
  const std::size_t step = std::max<std::size_t>(1, file.size() / 300);
  for (std::size_t at = 0; at < file.size(); at += step) {
    std::string wrong = file;
    wrong[at] = static_cast<char>(wrong[at] ^ 0x55);
    expect_refused_or_read(wrong, GetParam().format);
  }
}

TEST_P(ReadBack, EndsWhenItIsCancelled) {
  const std::string file = file_of(test::large_mesh());
  std::stop_source stop;
  stop.request_stop();
  EXPECT_EQ(test::code_thrown_by([&] {
              read(file, {stop.get_token(), nullptr});
            }),
            ErrorCode::kCancelled);
}

std::string name_of(const testing::TestParamInfo<Kind>& test) {
  std::string name(to_string(test.param.format));
  if (test.param.format == MeshFormat::kGlb) name += "_" + std::string(to_string(test.param.codec));
  std::ranges::replace(name, '-', '_');
  return name;
}

constexpr Kind glb_with(GlbCodec codec) { return {MeshFormat::kGlb, codec}; }

INSTANTIATE_TEST_SUITE_P(Formats, ReadBack,
                         testing::Values(Kind{MeshFormat::kDrc}, glb_with(GlbCodec::kDraco),
                                         glb_with(GlbCodec::kMeshopt),
                                         glb_with(GlbCodec::kKhrMeshopt),
                                         glb_with(GlbCodec::kQuantized), glb_with(GlbCodec::kNone)),
                         name_of);

class ReadBackGlb : public ReadBack {};

// The container's header says how long the file is, so a file that ends too soon is refused before
// its arrays are read. Here the lengths are those of a complete file.
TEST_P(ReadBackGlb, WithoutTheEndOfItsArraysIsRefused) {
  const std::string file = file_of(test::meshes_to_encode().at(2).mesh);
  const std::size_t binary = file.size() - test::open_container(file).binary.size();
  const auto put = [](std::string& bytes, std::size_t at, std::size_t value) {
    const auto word = static_cast<std::uint32_t>(value);
    std::memcpy(bytes.data() + at, &word, sizeof word);
  };
  constexpr std::size_t kCuts = 300;
  const std::size_t step = 4 * (1 + (file.size() - binary) / (4 * kCuts));
  for (std::size_t bytes = file.size() - 4; bytes >= binary; bytes -= step) {
    std::string shorter = file.substr(0, bytes);
    put(shorter, 8, bytes);
    put(shorter, binary - 8, bytes - binary);
    EXPECT_EQ(test::code_thrown_by([&] { read(shorter); }), ErrorCode::kInternal) << bytes;
  }
}

// Counts, lengths, offsets and types that do not fit the arrays.
TEST_P(ReadBackGlb, WithWrongNumbersIsRefusedOrReadButNeverWorse) {
  const std::string file = file_of(test::meshes_to_encode().at(2).mesh);
  const std::size_t json_end = 20 + std::size_t{test::word_at(file, 12)};
  std::size_t tried = 0;
  for (std::size_t at = 20; at < json_end; ++at) {
    if (std::isdigit(static_cast<unsigned char>(file[at])) == 0) continue;
    for (const char digit : {'0', '1', '3', '5', '9'}) {
      if (digit == file[at]) continue;
      std::string wrong = file;
      wrong[at] = digit;
      expect_refused_or_read(wrong, MeshFormat::kGlb);
      ++tried;
    }
  }
  EXPECT_GT(tried, 200U);
}

INSTANTIATE_TEST_SUITE_P(Codecs, ReadBackGlb,
                         testing::Values(glb_with(GlbCodec::kDraco), glb_with(GlbCodec::kMeshopt),
                                         glb_with(GlbCodec::kQuantized), glb_with(GlbCodec::kNone)),
                         name_of);

TEST(ReadBackOthers, IsRefused) {
  const std::string stl = encoded(test::meshes_to_encode().at(2).mesh, MeshFormat::kStl);
  EXPECT_EQ(test::code_thrown_by([&] { decoded(stl, MeshFormat::kStl); }), ErrorCode::kInternal);
}

TEST(ReadBackOthers, IsRefusedInAnotherSpace) {
  std::string glb = encoded(test::meshes_to_encode().at(2).mesh, MeshFormat::kGlb);
  const std::size_t at = glb.find("\"scale\":[0.001");
  ASSERT_NE(at, std::string::npos);
  glb[at + 13] = '2';
  const auto error = test::thrown_by([&] { decoded(glb, MeshFormat::kGlb); });
  ASSERT_TRUE(error.has_value());
  EXPECT_NE(std::string(error->what()).find("LPS"), std::string::npos) << error->what();
}

class ReadBackLabels : public test::LabelFilesTest {};

TEST_F(ReadBackLabels, AreTheTrianglesOfAllLabels) {
  std::size_t triangles = 0;
  for (const LabelSummary& label : labels_) triangles += label.triangles;
  const DecodedSurface glb = decoded(encoded(MeshFormat::kGlb), MeshFormat::kGlb);
  EXPECT_EQ(glb.triangles.size(), triangles);
  // Each of two labels has the corners of their wall, which is there once before encoding.
  EXPECT_GT(glb.positions.size(), walls_.mesh.positions.size());
}

TEST_F(ReadBackLabels, AreJoinedOneBehindTheOther) {
  const Zip zip = zipped({MeshFormat::kDrc});
  std::vector<DecodedSurface> parts;
  std::vector<mesh::Vec3> positions;
  std::vector<std::array<mesh::Vec3, 3>> triangles;
  const auto add_triangles = [](const mesh::SurfaceView& from, auto& to) {
    for (const auto& [a, b, c] : from.triangles) {
      to.push_back({from.positions[a], from.positions[b], from.positions[c]});
    }
  };
  for (const LabelFiles& files : zip.files) {
    const LabelFile& file = files.at(MeshFormat::kDrc);
    parts.push_back(decoded(zip.bytes.substr(file.offset, file.bytes), MeshFormat::kDrc));
    positions.insert(positions.end(), parts.back().positions.begin(), parts.back().positions.end());
    add_triangles(parts.back().view(), triangles);
  }
  const DecodedSurface all = join(std::move(parts), {});
  EXPECT_TRUE(std::ranges::equal(all.positions, positions));
  std::vector<std::array<mesh::Vec3, 3>> joined;
  add_triangles(all.view(), joined);
  EXPECT_TRUE(joined == triangles);
  EXPECT_EQ(join({}, {}).triangles.size(), 0U);
}

}  // namespace
}  // namespace isomesh::codec
