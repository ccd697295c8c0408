// Files that are no meshes end in an error that says why.
#include <cstring>
#include <functional>
#include <limits>
#include <string>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "base/error.h"
#include "tests/support/files.h"
#include "tests/unit/verify/made.h"

namespace isomesh::test {
namespace {

using testing::HasSubstr;

std::string file_in(MeshFormat format) {
  MeshParameters parameters = parameters_within(0.4);
  parameters.formats = {format};
  return made(balls(), parameters);
}

std::string why(const std::string& bytes) {
  try {
    verify::read_surface(bytes);
  } catch (const Error& error) {
    EXPECT_EQ(error.code(), ErrorCode::kInvalidParameter);
    return error.what();
  }
  return "";
}

std::string replaced(std::string bytes, const std::string& from, const std::string& to) {
  const std::size_t at = bytes.find(from);
  EXPECT_NE(at, bytes.npos) << from;
  return bytes.replace(at, from.size(), to);
}

// A text STL of one triangle.
constexpr const char* kText =
    "solid a b\n facet normal 0 0 1\n  outer loop\n   vertex 0 0 0\n   vertex 1e0 0 0\n"
    "   vertex 0 1 -0.5\n  endloop\n endfacet\nendsolid a b\n";

TEST(VerifyFiles, OfAllFormatsHoldTheSameSurface) {
  const verify::Surface stl = verify::read_surface(file_in(MeshFormat::kStl));
  for (const MeshFormat format : {MeshFormat::kPly, MeshFormat::kGlb}) {
    const verify::Surface other = verify::read_surface(file_in(format));
    EXPECT_EQ(other.points, stl.points);
    EXPECT_EQ(other.triangles, stl.triangles);
  }
  const verify::Surface text = verify::read_surface(kText);
  ASSERT_EQ(text.triangles.size(), 1U);
  EXPECT_EQ(verify::normal_of(text.corners(0)), (verify::Vec{0, 0.5, 1}));
}

TEST(VerifyFiles, ThatAreTruncatedAnywhereAreErrors) {
  for (const MeshFormat format : {MeshFormat::kStl, MeshFormat::kPly, MeshFormat::kGlb}) {
    const std::string whole = file_in(format);
    for (std::size_t size = 0; size < whole.size(); size += size < 2000 ? 1 : 97) {
      EXPECT_THAT(why(whole.substr(0, size)), HasSubstr("the mesh cannot be read: "));
    }
    EXPECT_NE(why(whole.substr(0, whole.size() - 1)), "");
    EXPECT_NE(why(whole + "more"), "");
  }
  const std::string text = kText;
  for (std::size_t size = 0; size < text.find("endsolid"); ++size) {
    EXPECT_NE(why(text.substr(0, size)), "") << size;
  }
}

TEST(VerifyFiles, ThatAreNoMeshesAreErrors) {
  EXPECT_THAT(why(""), HasSubstr("too short"));
  EXPECT_THAT(why(std::string(1000, 'x')), HasSubstr("1000 bytes, but an STL file of"));
  EXPECT_THAT(why("solid of nothing\n" + std::string(100, 'x')), HasSubstr("truncated"));
  EXPECT_THAT(why("ply\nformat ascii 1.0\nend_header\n" + std::string(100, '0')),
              HasSubstr("not that of isomesh"));
}

TEST(VerifyFiles, WithCoordinatesThatAreNotFiniteAreErrors) {
  for (const float bad :
       {std::numeric_limits<float>::quiet_NaN(), -std::numeric_limits<float>::infinity(), 1e38F}) {
    std::string stl = file_in(MeshFormat::kStl);
    std::memcpy(&stl[84 + 12 + 50 * 7], &bad, sizeof bad);
    EXPECT_THAT(why(stl), HasSubstr("not finite"));
  }
  EXPECT_THAT(why(replaced(kText, "1e0", "nan")), HasSubstr("no number"));
  EXPECT_THAT(why(replaced(kText, "1e0", "1,0")), HasSubstr("no number"));
}

// No memory is taken for what the file only says.
TEST(VerifyFiles, WithCountsBeyondTheirSizeAreErrors) {
  std::string stl = file_in(MeshFormat::kStl);
  std::memcpy(&stl[80], "\xff\xff\xff\xff", 4);
  EXPECT_THAT(why(stl), HasSubstr("4294967295 triangles"));
  const std::string ply = file_in(MeshFormat::kPly);
  for (const char* element : {"element vertex ", "element face "}) {
    for (const char* count : {"9", "18446744073709551615", "-1", "x"}) {
      EXPECT_THAT(why(replaced(ply, element, element + std::string(count))),
                  HasSubstr("another size"));
    }
  }
  const std::string glb = file_in(MeshFormat::kGlb);
  EXPECT_NE(why(replaced(glb, "\"count\":", "\"count\":9")), "");
  EXPECT_NE(why(replaced(glb, "\"mesh\":0", "\"mesh\":7")), "");
  EXPECT_NE(why(replaced(glb, "\"VEC3\"", "\"VEC2\"")), "");
  EXPECT_NE(why(replaced(glb, "\"nodes\":[0]", "\"nodes\":[9]")), "");
}

TEST(VerifyFiles, WithIndicesBeyondTheVerticesAreErrors) {
  for (const MeshFormat format : {MeshFormat::kPly, MeshFormat::kGlb}) {
    std::string file = file_in(format);
    // The last index of a PLY, and the last bytes of a GLB that are no padding.
    std::memcpy(&file[file.size() - 4], "\xff\xff\xff\x7f", 4);
    EXPECT_NE(why(file), "") << static_cast<int>(format);
  }
}

TEST(VerifyFiles, WithACodecAreErrors) {
  MeshParameters parameters = parameters_within(0.4);
  parameters.formats = {MeshFormat::kGlb};
  parameters.glb_codec = GlbCodec::kDraco;
  EXPECT_THAT(why(made(balls(), parameters)), HasSubstr("has a codec; ask for none"));
}

// Their bound counts from another surface than the one at an iso-value.
TEST(VerifyFiles, OfLabelsSayThatTheyCannotBeChecked) {
  const std::string ply = replaced(file_in(MeshFormat::kPly), "property float z\n",
                                   "property float z\nproperty uint label\n");
  EXPECT_THAT(why(ply), HasSubstr("of labels, which cannot be checked"));
  const std::string glb = replaced(file_in(MeshFormat::kGlb), "\"interpolation\":\"linear\"",
                                   "\"labels\":\"all\"          ");
  EXPECT_THAT(why(glb), HasSubstr("of labels, which cannot be checked"));
  EXPECT_EQ(why(file_in(MeshFormat::kGlb)), "");
}

}  // namespace
}  // namespace isomesh::test
