// Files of labels: what two labels share has the same bits in both, whatever the format.
#include "tests/unit/codec/label_files.h"

#include <algorithm>
#include <array>
#include <cstring>
#include <map>
#include <memory>
#include <set>
#include <sstream>
#include <string>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include "base/sha256.h"
#include "server/codec/label_titles.h"
#include "tests/unit/codec/decode.h"
#include "tests/unit/codec/foreign.h"
#include "tests/unit/codec/foreign_3mf.h"
#include "tests/unit/codec/glb_container.h"
#include "tests/unit/codec/unzipped.h"

namespace isomesh::codec {
namespace {

using mesh::Vec3;
using test::LabelFilesTest;
using test::unzipped;
using Places = LabelFilesTest::Places;

Places places_in_stl(const std::string& bytes) {
  Places places;
  for (std::size_t facet = 84; facet + 50 <= bytes.size(); facet += 50) {
    for (std::size_t corner = 0; corner < 3; ++corner) {
      Vec3 place;
      std::memcpy(&place, bytes.data() + facet + 12 * (corner + 1), sizeof place);
      places.insert(place);
    }
  }
  return places;
}

Places places_of(const test::DecodedMesh& decoded) {
  return {decoded.points.begin(), decoded.points.end()};
}

TEST_F(LabelFilesTest, ZipHoldsAFileOfEachLabelThatIsARangeOfIt) {
  const Zip zip = zipped({MeshFormat::kStl, MeshFormat::kDrc});
  const auto files = unzipped(zip.bytes);
  EXPECT_EQ(files.size(), 2 * kLabels);
  EXPECT_TRUE(files.contains("label 1.stl"));
  EXPECT_TRUE(files.contains("Left ventr\u00edculo.drc"));
  std::vector<Places> stl;
  std::vector<Places> drc;
  for (std::size_t n = 0; n < kLabels; ++n) {
    for (const auto& [format, file] : zip.files[n]) {
      const std::string range = zip.bytes.substr(file.offset, file.bytes);
      EXPECT_EQ(range, files.at(title_of(labels_[n]) + '.' + std::string(to_string(format))));
      EXPECT_EQ(sha256_of(range), file.sha256);
    }
    const auto range_of = [&](MeshFormat format) {
      const LabelFile& file = zip.files[n].at(format);
      return zip.bytes.substr(file.offset, file.bytes);
    };
    const std::string facets = range_of(MeshFormat::kStl);
    EXPECT_EQ(facets.size(), 84 + 50 * labels_[n].triangles);
    stl.push_back(places_in_stl(facets));
    const auto decoded = test::decode_in_process(range_of(MeshFormat::kDrc));
    EXPECT_EQ(decoded.triangles.size(), labels_[n].triangles);
    drc.push_back(places_of(decoded));
  }
  expect_shared(stl);
  expect_shared(drc);
}

TEST_F(LabelFilesTest, TitlesThatAreAlikeOrNoFileNamesMakeNoTwoFilesOne) {
  labels_[0].name = "../a/b";
  labels_[1].name = "Same";
  labels_[2].name = "same";
  labels_[3].name = "same-3";
  labels_[4].name = ".. ";
  const auto files = unzipped(zipped({MeshFormat::kStl}).bytes);
  std::vector<std::string> names;
  for (const auto& [name, bytes] : files) names.push_back(name);
  EXPECT_EQ(names, (std::vector<std::string>{"Same.stl", "_.._a_b.stl", "_.stl", "same-3-4.stl",
                                             "same-3.stl"}));
}

// Windows and macOS ignore the case of all letters, and macOS how they are composed.
TEST_F(LabelFilesTest, NamesInAZipDifferInMoreThanTheCaseOfLettersBeyondAscii) {
  labels_[0].name = "\u00c4derchen";
  labels_[1].name = "\u00e4derchen";
  labels_[2].name = "a\u0308derchen";
  labels_[3].name = "\u0421\u0415\u0420\u0414\u0426\u0415";
  labels_[4].name = "\u0441\u0435\u0440\u0434\u0446\u0435";
  std::vector<std::string> names;
  for (const auto& [name, bytes] : unzipped(zipped({MeshFormat::kStl}).bytes))
    names.push_back(name);
  // libarchive composes letters.
  EXPECT_THAT(names, testing::UnorderedElementsAre("\u00c4derchen.stl", "\u00e4derchen-2.stl",
                                                   "\u00e4derchen-3.stl",
                                                   "\u0421\u0415\u0420\u0414\u0426\u0415.stl",
                                                   "\u0441\u0435\u0440\u0434\u0446\u0435-5.stl"));
}

TEST_F(LabelFilesTest, NoNameInAZipIsADeviceOfWindows) {
  labels_[0].name = "con";
  labels_[1].name = "LPT1.left";
  labels_[2].name = "Aux";
  labels_[3].name = "com10";
  labels_[4].name = "console";
  std::vector<std::string> names;
  for (const auto& [name, bytes] : unzipped(zipped({MeshFormat::kStl}).bytes))
    names.push_back(name);
  EXPECT_THAT(names, testing::UnorderedElementsAre("_con.stl", "_LPT1.left.stl", "_Aux.stl",
                                                   "com10.stl", "console.stl"));
}

// Connectome Workbench tells what a GIFTI file is by its name.
TEST_F(LabelFilesTest, GiftiInAZipIsNamedAsASurface) {
  EXPECT_TRUE(unzipped(zipped({MeshFormat::kGii}).bytes).contains("label 1.surf.gii"));
}

TEST_F(LabelFilesTest, NamesInAZipAreNoLongerThanSystemsTake) {
  labels_[0].name = std::string(254, 'x');
  labels_[1].name = std::string(254, 'x') + 'y';
  labels_[2].name.emplace();
  for (int n = 0; n < 127; ++n) *labels_[2].name += "\u00e9";
  for (const auto& [name, bytes] : unzipped(zipped({MeshFormat::kStl}).bytes)) {
    EXPECT_LE(name.size(), 255U);
    EXPECT_TRUE(name.ends_with(".stl")) << name;
  }
}

TEST_F(LabelFilesTest, GroupsOfLabelsThatAreNamedAlikeAreTold) {
  labels_[0].name = "a b";
  labels_[3].name = "a_b";
  const std::string obj = encoded(MeshFormat::kObj);
  EXPECT_NE(obj.find("o a_b\n"), std::string::npos);
  EXPECT_NE(obj.find("g a_b\n"), std::string::npos);
  EXPECT_NE(obj.find("g a_b-4\n"), std::string::npos);
  EXPECT_NE(obj.find("usemtl a_b-4\n"), std::string::npos);
}

// A backslash there would continue the line.
TEST_F(LabelFilesTest, NoGroupEndsInABackslash) {
  labels_[0].name = "a\\";
  const std::string obj = encoded(MeshFormat::kObj);
  EXPECT_NE(obj.find("g a_\n"), std::string::npos);
  EXPECT_EQ(obj.find('\\'), std::string::npos);
}

TEST_F(LabelFilesTest, MaterialsAreNamedLikeTheGroupsAndHaveTheLabelsColours) {
  LabelSummary label;
  label.label = 3;
  label.name = "a b";
  label.color = "#ff8000";
  ObjGroups groups;
  EXPECT_EQ(mtl_material(groups.of(label), label), "newmtl a_b\nKd 1.000000 0.501961 0.000000\n");
  label.label = 4;
  label.color.reset();
  const std::string other = mtl_material(groups.of(label), label);
  EXPECT_TRUE(other.starts_with("newmtl a_b-4\nKd 0.")) << other;
}

TEST_F(LabelFilesTest, ZipIsTheSameOnAnyNumberOfThreads) {
  const int before = mesh::thread_count();
  mesh::set_thread_count(1);
  const std::string one = zipped({MeshFormat::kDrc}).bytes;
  mesh::set_thread_count(4);
  const std::string four = zipped({MeshFormat::kDrc}).bytes;
  mesh::set_thread_count(before);
  EXPECT_EQ(one, four);
}

TEST_F(LabelFilesTest, ASinkThatThrowsEndsTheZipWithThat) {
  EXPECT_THROW(
      encode_labels_zip(surface(), std::array{MeshFormat::kStl}, provenance_, {},
                        [](std::span<const std::byte>) { throw std::runtime_error("full"); }),
      std::runtime_error);
}

TEST_F(LabelFilesTest, GlbHasANodeWithNameColourAndFiguresForEachLabel) {
  const std::string glb = encoded(MeshFormat::kGlb);
  const auto gltf = test::open_container(glb).document;
  ASSERT_EQ(gltf["nodes"].size(), kLabels + 1);
  EXPECT_EQ(gltf["nodes"][0]["children"].size(), kLabels);
  for (std::size_t n = 0; n < kLabels; ++n) {
    const auto& node = gltf["nodes"][gltf["nodes"][0]["children"][n].get<std::size_t>()];
    EXPECT_EQ(node["name"], title_of(labels_[n]));
    EXPECT_EQ(node["extras"]["label"], labels_[n].label);
    EXPECT_EQ(node["extras"]["voxels"], labels_[n].voxels);
    ASSERT_TRUE(labels_[n].encloses_volume());
    EXPECT_EQ(node["extras"]["volume_mm3"], labels_[n].volume_mm3);
    EXPECT_EQ(node["extras"]["area_mm2"], labels_[n].area_mm2);
    EXPECT_EQ(gltf["meshes"][node["mesh"].get<std::size_t>()]["name"], node["name"]);
  }
  // #ff8000 is 1, 0.216, 0 in linear light.
  const auto color = gltf["materials"][1]["pbrMetallicRoughness"]["baseColorFactor"];
  EXPECT_NEAR(color[0].get<double>(), 1, 1e-9);
  EXPECT_NEAR(color[1].get<double>(), 0.2159, 1e-4);
  EXPECT_NEAR(color[2].get<double>(), 0, 1e-9);
  EXPECT_NE(gltf["materials"][0]["pbrMetallicRoughness"],
            gltf["materials"][2]["pbrMetallicRoughness"]);
  EXPECT_FALSE(gltf["asset"]["extras"].contains("iso"));
}

TEST_F(LabelFilesTest, GlbHasNoVolumeOfAnOpenLabel) {
  labels_[1].closed = false;
  const auto nodes = test::open_container(encoded(MeshFormat::kGlb)).document["nodes"];
  for (const auto& node : nodes) {
    if (!node.contains("extras")) continue;
    EXPECT_EQ(node["extras"].contains("volume_mm3"), node["extras"]["label"] != 2) << node;
    EXPECT_TRUE(node["extras"].contains("area_mm2"));
  }
}

TEST_F(LabelFilesTest, PlyNumbersTheVerticesThatTheJobReports) {
  ++labels_[1].vertices;
  EXPECT_THROW(encoded(MeshFormat::kPly), Error);
}

TEST_F(LabelFilesTest, GlbIsValidAndItsWallsAreShared) {
  const auto primitives = test::read_with_node(encoded(MeshFormat::kGlb));
  ASSERT_EQ(primitives.size(), kLabels);
  std::vector<Places> places;
  for (std::size_t n = 0; n < kLabels; ++n) {
    EXPECT_EQ(primitives[n].mesh.triangles.size(), labels_[n].triangles);
    places.push_back(places_of(primitives[n].mesh));
  }
  expect_shared(places);
}

TEST_F(LabelFilesTest, GlbHasNormalsWhereTheyAreAskedFor) {
  provenance_.parameters.normals = true;
  for (const auto& primitive : test::read_with_node(encoded(MeshFormat::kGlb))) {
    EXPECT_EQ(primitive.normals.size(), primitive.mesh.points.size());
  }
}

TEST_F(LabelFilesTest, LabelsWithoutTrianglesHaveANodeWithoutAMesh) {
  const auto empty = test::constant<std::uint8_t>(3, {4, 4, 4});
  mesh::separate_into(walls_, empty, {{3}, Scheme::kSix, false});
  surfaces_ = label_surfaces(walls_, {});
  labels_ = {{.label = 3}};
  const std::string glb = encoded(MeshFormat::kGlb);
  EXPECT_NE(glb.find("label 3"), std::string::npos);
  EXPECT_EQ(unzipped(zipped({MeshFormat::kStl}).bytes).at("label 3.stl").size(), 84U);
  EXPECT_NE(encoded(MeshFormat::kPly).find("element face 0"), std::string::npos);
  EXPECT_EQ(encoded(MeshFormat::kObj), "# isomesh, millimetres, SPACE=LPS\nmtllib mesh.mtl\n");
  const test::Model3mf model = test::read_with_lib3mf(encoded(MeshFormat::k3mf));
  EXPECT_TRUE(model.objects.empty());
  EXPECT_EQ(model.metadata.at("Title"), "no label");
}

// Some readers fail at a property of faces beside the list of their vertices.
TEST_F(LabelFilesTest, PlyHasEveryLabelsOwnVerticesWithItsColourAndValue) {
  const std::string ply = encoded(MeshFormat::kPly);
  const std::string end =
      "property uint8 red\nproperty uint8 green\nproperty uint8 blue\nproperty int label\n"
      "element face " +
      std::to_string(faces_of_all()) + "\nproperty list uchar uint vertex_indices\nend_header\n";
  const std::size_t found = ply.find(end);
  ASSERT_NE(found, std::string::npos) << ply.substr(0, 500);
  std::size_t at = found + end.size();
  std::vector<std::int32_t> label_of_vertex;
  for (const LabelSummary& label : labels_) {
    for (std::uint64_t v = 0; v < label.vertices; ++v, at += 19) {
      std::memcpy(&label_of_vertex.emplace_back(), ply.data() + at + 15, sizeof(std::int32_t));
      EXPECT_EQ(label_of_vertex.back(), label.label);
      if (label.color) {
        EXPECT_EQ(ply.substr(at + 12, 3), std::string("\xff\x80\0", 3));
      }
    }
  }
  std::map<std::int32_t, std::uint64_t> faces;
  for (; at + 13 <= ply.size(); at += 13) {
    EXPECT_EQ(ply[at], 3);
    mesh::Triangle corners;
    std::memcpy(&corners, ply.data() + at + 1, sizeof corners);
    const std::int32_t label = label_of_vertex.at(corners[0]);
    EXPECT_EQ(label_of_vertex.at(corners[1]), label);
    EXPECT_EQ(label_of_vertex.at(corners[2]), label);
    ++faces[label];
  }
  EXPECT_EQ(at, ply.size());
  for (const LabelSummary& label : labels_) {
    EXPECT_EQ(faces[static_cast<std::int32_t>(label.label)], label.triangles);
  }
}

// PLY has no such integers.
TEST_F(LabelFilesTest, LabelsMayHave64Bits) {
  constexpr std::int64_t kId = 720575940618780781;
  labels_.back().label = kId;
  const std::string ply = encoded(MeshFormat::kPly);
  EXPECT_NE(ply.find("comment label 5 is 720575940618780781\n"), std::string::npos);
  EXPECT_NE(ply.find("property uint label\nelement face "), std::string::npos);
  std::uint32_t number = 0;
  const std::size_t end_of_vertices = ply.size() - 13 * faces_of_all();
  std::memcpy(&number, ply.data() + end_of_vertices - sizeof number, sizeof number);
  EXPECT_EQ(number, 5U);
  std::int64_t label = 0;
  const std::string vtk = encoded(MeshFormat::kVtk);
  EXPECT_NE(vtk.find("SCALARS label vtktypeint64 1\n"), std::string::npos);
  std::memcpy(&label, vtk.data() + vtk.size() - 1 - sizeof label, sizeof label);
  EXPECT_EQ(__builtin_bswap64(static_cast<std::uint64_t>(label)), std::uint64_t{kId});
  const std::string vtp = encoded(MeshFormat::kVtp);
  EXPECT_NE(vtp.find("type=\"Int64\" Name=\"label\""), std::string::npos);
  const std::size_t end = vtp.rfind("\n</AppendedData>");
  std::memcpy(&label, vtp.data() + end - sizeof label, sizeof label);
  EXPECT_EQ(label, kId);
  EXPECT_NE(encoded(MeshFormat::kGlb).find("\"label\":\"720575940618780781\""), std::string::npos);
}

// Blender makes an object of each `o`, and drops a face whose vertices another face has, too.
TEST_F(LabelFilesTest, ObjHasAnObjectWithVerticesOfItsOwnForEachLabel) {
  const std::string obj = encoded(MeshFormat::kObj);
  EXPECT_TRUE(obj.starts_with("# isomesh, millimetres, SPACE=LPS\nmtllib mesh.mtl\no label_1\nv "));
  std::istringstream lines(obj);
  std::size_t objects = 0;
  std::uint64_t first = 1;
  std::uint64_t vertices = 0;
  for (std::string line; std::getline(lines, line);) {
    if (line.starts_with("o ")) {
      first += vertices;
      vertices = 0;
      ++objects;
    }
    if (line.starts_with("v ")) ++vertices;
    if (!line.starts_with("f ")) continue;
    EXPECT_EQ(vertices, labels_.at(objects - 1).vertices);
    std::istringstream corners(line.substr(2));
    for (std::uint64_t corner = 0; corners >> corner;) {
      EXPECT_GE(corner, first);
      EXPECT_LT(corner, first + vertices);
    }
  }
  EXPECT_EQ(objects, kLabels);
}

TEST_F(LabelFilesTest, ObjHasAGroupForEachLabel) {
  const std::string obj = encoded(MeshFormat::kObj);
  std::istringstream lines(obj);
  std::vector<std::pair<std::string, std::uint64_t>> groups;
  for (std::string line; std::getline(lines, line);) {
    if (line.starts_with("g ")) groups.emplace_back(line.substr(2), 0);
    if (line.starts_with("f ")) ++groups.at(groups.size() - 1).second;
  }
  ASSERT_EQ(groups.size(), kLabels);
  for (std::size_t n = 0; n < kLabels; ++n) EXPECT_EQ(groups[n].second, labels_[n].triangles);
  EXPECT_EQ(groups[0].first, "label_1");
  EXPECT_EQ(groups[1].first, "Left_ventr\u00edculo");
  EXPECT_EQ(test::objects_in(obj, "obj"),
            (std::vector<std::string>{"label_1", "Left_ventr\u00edculo", "label_3", "label_4",
                                      "label_5"}));
}

TEST_F(LabelFilesTest, ThreeMfHasAnObjectWithNameColourAndValueForEachLabel) {
  labels_[2].name = "a < b & \"c\"\x01";
  const std::string bytes = encoded(MeshFormat::k3mf);
  EXPECT_EQ(test::objects_in(bytes, "3mf").size(), kLabels);
  const test::Model3mf model = test::read_with_lib3mf(bytes);
  EXPECT_TRUE(model.is_in_millimetres);
  EXPECT_EQ(model.items, 1U);
  EXPECT_EQ(model.together, "5 labels");
  EXPECT_EQ(model.metadata.at("Title"), "5 labels");
  EXPECT_EQ(model.metadata.at("Description"),
            "The surface of 5 labels. Coordinates in LPS, in millimetres.");
  ASSERT_EQ(model.objects.size(), kLabels);
  std::vector<Places> places;
  for (std::size_t n = 0; n < kLabels; ++n) {
    const test::Object3mf& object = model.objects[n];
    EXPECT_EQ(object.name, n == 2 ? "a < b & \"c\"\uFFFD" : title_of(labels_[n]));
    EXPECT_EQ(object.part_number, std::to_string(labels_[n].label));
    EXPECT_TRUE(object.is_model);
    EXPECT_EQ(object.points.size(), labels_[n].vertices);
    EXPECT_EQ(object.triangles.size(), labels_[n].triangles);
    places.push_back({object.points.begin(), object.points.end()});
  }
  EXPECT_EQ(model.objects[1].color, (std::array<std::uint8_t, 3>{0xff, 0x80, 0}));
  EXPECT_NE(model.objects[0].color, model.objects[2].color);
  expect_shared(places);
}

TEST_F(LabelFilesTest, ThreeMfOfOneLabelIsThatObject) {
  const auto volume = mesh::label_cells(1, {12, 12, 12}, 4, 401);
  mesh::separate_into(walls_, volume, {{1, 2}, Scheme::kSix, true});
  surfaces_ = label_surfaces(walls_, {});
  labels_ = {{.label = 1, .name = "Liver"}, {.label = 2, .name = "Spleen"}};
  const test::Model3mf model = test::read_with_lib3mf(encoded(MeshFormat::k3mf));
  EXPECT_EQ(model.items, 1U);
  EXPECT_EQ(model.together, "");
  ASSERT_EQ(model.objects.size(), 1U);
  EXPECT_EQ(model.objects[0].name, "Liver");
  EXPECT_EQ(model.metadata.at("Title"), "Liver");
}

TEST_F(LabelFilesTest, AFileOfOneSurfaceIsNoFileOfAllLabels) {
  EXPECT_THROW(encoded(MeshFormat::kStl), Error);
}

}  // namespace
}  // namespace isomesh::codec
