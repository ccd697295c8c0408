// 3MF files as PrusaSlicer loads them: surfaces and labels, whole and in their places.
#include <cmath>
#include <stdexcept>
#include <string>
#include <vector>

#include <gtest/gtest.h>

#include "base/text.h"
#include "server/codec/label_titles.h"
#include "tests/support/files.h"
#include "tests/support/process.h"
#include "tests/unit/codec/foreign.h"
#include "tests/unit/codec/foreign_3mf.h"
#include "tests/unit/codec/label_files.h"
#include "tests/unit/codec/meshes.h"
#include "tests/unit/codec/unzipped.h"

namespace isomesh::codec {
namespace {

using Corners = std::array<mesh::Vec3, 3>;

class PrusaSlicerTest : public test::LabelFilesTest {
 protected:
  static void SetUpTestSuite() {
    is_here_ = test::run({"sh", "-c", "command -v prusa-slicer"}).status == 0;
  }

  void SetUp() override {
    if (!is_here_) GTEST_SKIP() << "PrusaSlicer (the package prusa-slicer) is not installed";
  }

  test::Finished run(const std::vector<std::string>& words, const std::string& bytes) const {
    test::write_file(folder_ / "in.3mf", bytes);
    return test::run(test::with(test::with({"prusa-slicer", "--datadir", folder_ / "data"}, words),
                                {folder_ / "in.3mf"}));
  }

  // By default, it lowers each object to the bed.
  std::string exported(const std::string& suffix, const std::string& bytes,
                       const std::vector<std::string>& words = {"--no-ensure-on-bed"}) const {
    const std::string out = folder_ / ("out." + suffix);
    const test::Finished finished =
        run(test::with({"--export-" + suffix, "--output", out}, words), bytes);
    if (finished.status != 0) throw std::runtime_error(finished.output + finished.errors);
    return test::read_file(out);
  }

  // The numbers of what it says of each object, in their order.
  std::vector<std::string> told(const std::string& name, const std::string& bytes) const {
    std::vector<std::string> values;
    const std::string prefix = name + " = ";
    const test::Finished finished = run({"--info"}, bytes);
    for (const std::string_view line : lines(finished.output)) {
      if (line.starts_with(prefix)) values.emplace_back(line.substr(prefix.size()));
    }
    return values;
  }

  void expect_in_place(const std::string& bytes) const {
    std::vector<Corners> expected;
    for (const test::Object3mf& object : test::read_with_lib3mf(bytes).objects) {
      for (const auto& [a, b, c] : object.triangles) {
        expected.push_back({object.points[a], object.points[b], object.points[c]});
      }
    }
    const std::vector<Corners> found = test::read_with_assimp(exported("stl", bytes), "stl");
    ASSERT_EQ(found.size(), expected.size());
    // It moves each object to the origin and back.
    constexpr float kRounded = 1e-5F;
    for (std::size_t t = 0; t < found.size(); ++t) {
      for (std::size_t corner = 0; corner < 3; ++corner) {
        for (std::size_t axis = 0; axis < 3; ++axis) {
          ASSERT_NEAR(found[t][corner][axis], expected[t][corner][axis], kRounded) << t;
        }
      }
    }
  }

  test::TemporaryFolder folder_;

 private:
  static inline bool is_here_ = false;
};

TEST_F(PrusaSlicerTest, LoadsAndSlicesASurface) {
  const std::string bytes = test::encoded(surface_of(1), MeshFormat::k3mf);
  EXPECT_EQ(told("number_of_facets", bytes), std::vector{std::to_string(labels_[0].triangles)});
  EXPECT_EQ(told("manifold", bytes), std::vector<std::string>{"yes"});
  expect_in_place(bytes);
  EXPECT_NE(exported("gcode", bytes, {"--fill-density", "0"}).find(";LAYER_CHANGE"),
            std::string::npos);
}

// It would reject a file with an object of the type "surface".
TEST_F(PrusaSlicerTest, LoadsAnOpenSurface) {
  mesh::Mesh surface = surface_of(1);
  surface.triangles.shrink(surface.triangles.size() - 1);
  const std::string bytes = test::encoded(surface, MeshFormat::k3mf);
  EXPECT_EQ(told("open_edges", bytes), std::vector<std::string>{"3"});
  expect_in_place(bytes);
}

TEST_F(PrusaSlicerTest, LoadsAllLabelsWithTheirNamesAndPlaces) {
  const std::string bytes = encoded(MeshFormat::k3mf);
  std::vector<std::string> triangles;
  for (const LabelSummary& label : labels_) triangles.push_back(std::to_string(label.triangles));
  EXPECT_EQ(told("number_of_facets", bytes), triangles);
  expect_in_place(bytes);
  const std::string objects =
      test::unzipped(exported("3mf", bytes)).at("Metadata/Slic3r_PE_model.config");
  for (const LabelSummary& label : labels_) {
    EXPECT_NE(objects.find("type=\"object\" key=\"name\" value=\"" + title_of(label) + '"'),
              std::string::npos)
        << objects;
  }
}

}  // namespace
}  // namespace isomesh::codec
