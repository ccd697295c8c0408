// Volumes read by us and by libraries of others: the same samples at the same places.
#include <algorithm>
#include <cmath>
#include <cstring>

#include <gtest/gtest.h>

#include "tests/support/files.h"
#include "tests/support/process.h"
#include "tests/unit/import/archives.h"
#include "tests/unit/import/files.h"
#include "tests/unit/import/other_writers.h"
#include "tests/unit/import/writers.h"

namespace isomesh::import::test {
namespace {

struct ForeignVolume {
  std::array<std::uint32_t, 3> dims = {};
  std::array<std::array<double, 3>, 4> lattice = {};  // the first sample, and the steps
  std::vector<double> samples;
};

ForeignVolume read_with_python(const std::filesystem::path& file, int volume) {
  const isomesh::test::TemporaryFolder folder;
  // Debian's own, which has its packages.
  const auto finished = isomesh::test::run({"/usr/bin/python3", ISOMESH_READ_VOLUME, file.string(),
                                            std::to_string(volume), folder / "out"});
  if (finished.status != 0) throw std::runtime_error(finished.errors);
  const std::string out = isomesh::test::read_file(folder / "out");
  ForeignVolume found;
  constexpr std::size_t kHead = sizeof(found.dims) + sizeof(found.lattice);
  std::memcpy(found.dims.data(), out.data(), sizeof(found.dims));
  std::memcpy(found.lattice.data(), out.data() + sizeof(found.dims), sizeof(found.lattice));
  found.samples.resize((out.size() - kHead) / sizeof(double));
  std::memcpy(found.samples.data(), out.data() + kHead, found.samples.size() * sizeof(double));
  return found;
}

std::vector<double> as_doubles(const Outcome& outcome) {
  std::vector<double> result;
  with_sample(outcome.volume.type, [&](auto sample) {
    for (const auto value : samples_of<decltype(sample)>(outcome)) {
      result.push_back(static_cast<double>(value));
    }
  });
  return result;
}

void expect_same(const Outcome& outcome, const ForeignVolume& found) {
  constexpr double kRounding = 1e-6;  // of single precision, in headers and in samples
  ASSERT_EQ(outcome.error, "");
  ASSERT_EQ(outcome.volume.dims, found.dims);
  const Geometry& geometry = outcome.volume.geometry;
  // The rounding of the canonical geometry.
  const double most = 1e-4 * std::max(1.0, std::ranges::min(geometry.spacing));
  for (std::size_t row = 0; row < 3; ++row) {
    EXPECT_NEAR(geometry.origin[row], found.lattice[0][row], most);
    for (std::size_t axis = 0; axis < 3; ++axis) {
      EXPECT_NEAR(geometry.direction[row * 3 + axis] * geometry.spacing[axis],
                  found.lattice[axis + 1][row], 1e-5);
    }
  }
  const std::vector<double> samples = as_doubles(outcome);
  ASSERT_EQ(samples.size(), found.samples.size());
  for (std::size_t at = 0; at < samples.size(); ++at) {
    ASSERT_NEAR(samples[at], found.samples[at], kRounding * std::abs(found.samples[at])) << at;
  }
}

class ForeignVolumes : public testing::Test {
 protected:
  // One file, read by both.
  void expect_same_file(const std::string& name, const std::string& bytes,
                        const ImportOptions& options = {}) {
    SCOPED_TRACE(name);
    const auto path = folder_.write(name, bytes);
    const int volume = static_cast<int>(options.volume.value_or(0));
    expect_same(import_bytes(bytes, {}, options), read_with_python(path, volume));
  }

  Folder folder_;
};

const std::vector<std::int16_t>& numbers() {
  static const std::vector<std::int16_t> all = some_samples<std::int16_t>(48);
  return all;
}

TEST_F(ForeignVolumes, MghIsThatOfNibabel) {
  const MghFields fields = {.sizes = {4, 3, 2, 2},
                            .type = 4,
                            .spacing = {1, 2, 3},
                            .cosines = {-0.8F, 0.6F, 0, 0, 0, -1, 0.6F, 0.8F, 0},
                            .centre = {5, 6, 7}};
  expect_same_file("a.mgh", mgh(fields, bytes_of(numbers(), true)), {.volume = 1});
}

TEST_F(ForeignVolumes, NumPyIsThatOfNumPy) {
  const ImportOptions spaced = {.spacing = std::array<double, 3>{1, 1, 1}};
  for (const bool is_fortran : {false, true}) {
    expect_same_file("a.npy",
                     npy(npy_header(">i2", is_fortran, "(4, 3, 4)"), bytes_of(numbers(), true)),
                     spaced);
  }
  std::vector<std::uint16_t> halves;
  for (std::uint16_t at = 0; at < 24; ++at) halves.push_back(static_cast<std::uint16_t>(at * 2621));
  expect_same_file("a.npy", npy(npy_header("<f2", false, "(2, 3, 4)"), bytes_of(halves)), spaced);
}

TEST_F(ForeignVolumes, MrcIsThatOfVtk) {
  expect_same_file("a.mrc", mrc({.sizes = {4, 3, 4},
                                 .mode = 1,
                                 .sampling = {4, 3, 4},
                                 .cell = {4, 6, 10},
                                 .origin = {5, 6, 7}},
                                bytes_of(numbers())));
}

TEST_F(ForeignVolumes, CubeIsThatOfVtk) {
  std::string text;
  for (int at = 0; at < 24; ++at) text += " " + std::to_string(at * 0.37 - 2);
  expect_same_file(
      "a.cube",
      cube({.atoms = "1 1 2 3", .axes = {"2 1 0.5 0", "3 0 1 0.25", "4 0.125 0 1"}}, text + '\n'));
}

TEST_F(ForeignVolumes, StructuredPointsAreThoseOfVtk) {
  const std::string scalars = "SCALARS s short 1\nLOOKUP_TABLE default\n";
  const std::vector<std::int16_t> points(numbers().begin(), numbers().begin() + 24);
  expect_same_file("a.vtk",
                   vtk_legacy(false, "POINT_DATA 24\n" + scalars + bytes_of(points, true) + "\n"));
  expect_same_file(
      "a.vtk",
      vtk_legacy(true, "CELL_DATA 12\n" + scalars + "1 2 3 4 5 6 7 8 9 10 11 12\n", "4 3 3"));
  expect_same_file("a.vtk",
                   "# vtk DataFile Version 3.0\ntitle\nascii\ndataset structured_points\n"
                   "extent 2 5 -1 1 4 5\nspacing 1 2 3\norigin 10 20 30\npoint_data 24\n"
                   "scalars s Short 1\nlookup_table default\n"
                   "1 2 3 4 5 6 7 8 9 10 11 12 13 14 15 16 17 18 19 20 21 22 23 24\n");
}

TEST_F(ForeignVolumes, AfniIsThatOfNibabel) {
  const std::string head = afni_head({{"TYPESTRING", "string", "'3DIM_HEAD_ANAT~"},
                                      {"BRICK_TYPES", "integer", "1"},
                                      {"BRICK_FLOAT_FACS", "float", "0.25"},
                                      {"DATASET_DIMENSIONS", "integer", "4 3 4 0 0"},
                                      {"TEMPLATE_SPACE", "string", "'ORIG~"},
                                      {"IJK_TO_DICOM_REAL", "float", "2 0 1 7 0 -2 0 8 1 0 2 9"}});
  const std::string samples = bytes_of(numbers());
  folder_.write("a+orig.BRIK", samples);
  const auto path = folder_.write("a+orig.HEAD", head);
  expect_same(import_bytes(zip({{"a+orig.HEAD", head}, {"a+orig.BRIK", samples}})),
              read_with_python(path, 0));
}

TEST_F(ForeignVolumes, PagesOfTiffAreThoseOfPillow) {
  const std::string samples(kSmallSamples);
  expect_same_file("a.tif", tiff({samples.substr(0, 12), samples.substr(12)}),
                   {.spacing = std::array<double, 3>{1, 1, 1}});
}

// The files are a phantom's, with oblique slices of a real scanner; they come with nibabel.
TEST_F(ForeignVolumes, ParRecIsThatOfNibabel) {
  const std::filesystem::path data = "/usr/lib/python3/dist-packages/nibabel/tests/data";
  for (const std::string name : {"phantom_EPI_asc_CLEAR_2_1", "phantom_varscale"}) {
    SCOPED_TRACE(name);
    const std::string upload = zip({{name + ".PAR", read_file(data / (name + ".PAR"))},
                                    {name + ".REC", read_file(data / (name + ".REC"))}});
    expect_same(import_bytes(upload, {}, {.volume = 1}),
                read_with_python(data / (name + ".PAR"), 1));
  }
}

}  // namespace
}  // namespace isomesh::import::test
