// The unit that files tell: the millimetre, or the angstrom of the volume.
#include <array>
#include <string>
#include <utility>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include "server/codec/formats.h"
#include "tests/unit/codec/label_files.h"
#include "tests/unit/codec/meshes.h"
#include "tests/unit/codec/usd_reader.h"

namespace isomesh::codec {
namespace {

using test::encoded;
using testing::HasSubstr;
using testing::Not;

constexpr std::array kTold = {MeshFormat::kStl, MeshFormat::kPly, MeshFormat::kObj,
                              MeshFormat::kOff, MeshFormat::kVtk};

const std::vector<Note> kAngstrom = {note_of(NoteCode::kUnitAngstrom, "in angstrom")};

TEST(UnitOfFiles, IsInTheHeaders) {
  const mesh::Mesh mesh = std::move(test::meshes_to_encode().front().mesh);
  Provenance provenance;
  for (const MeshFormat format : kTold) {
    provenance.notes = {};
    EXPECT_THAT(encoded(mesh, format, provenance), HasSubstr(", millimetres, "))
        << to_string(format);
    provenance.notes = kAngstrom;
    const std::string file = encoded(mesh, format, provenance);
    EXPECT_THAT(file, HasSubstr(", angstrom, ")) << to_string(format);
    EXPECT_THAT(file, Not(HasSubstr("millimetres"))) << to_string(format);
  }
}

TEST(UnitOfFiles, IsInTheProvenanceAndInTheStageOfUsd) {
  const mesh::Mesh mesh = std::move(test::meshes_to_encode().front().mesh);
  Provenance provenance;
  provenance.notes = kAngstrom;
  const test::UsdStage stage = test::read_usda(encoded(mesh, MeshFormat::kUsda, provenance));
  EXPECT_EQ(stage.metres_per_unit, 1e-10);
  EXPECT_EQ(nlohmann::json::parse(stage.provenance)["units"], "angstrom");
}

class UnitOfLabels : public test::LabelFilesTest {};

TEST_F(UnitOfLabels, IsInTheHeaders) {
  provenance_.notes = kAngstrom;
  for (const MeshFormat format : kTold) {
    if (!holds_all_labels(format)) continue;
    EXPECT_THAT(encoded(format), HasSubstr(", angstrom, ")) << to_string(format);
  }
}

}  // namespace
}  // namespace isomesh::codec
