// ITK as the judge: what it writes is read as it reads it itself.

#include <cmath>

#include <gtest/gtest.h>
#include <itkMetaImageIO.h>
#include <itkNiftiImageIO.h>
#include <itkNrrdImageIO.h>

#include "tests/unit/import/files.h"
#include "tests/unit/import/itk_reader.h"
#include "tests/unit/import/writers.h"

namespace isomesh::import::test {
namespace {

constexpr std::array<std::uint32_t, 3> kDims = {5, 4, 3};

// A rotation about an axis that is none of the lattice's, its columns the axes' directions.
std::array<std::array<double, 3>, 3> oblique() {
  const double c = std::cos(0.4);
  const double s = std::sin(0.4);
  const double n = 1 / std::sqrt(3.0);
  std::array<std::array<double, 3>, 3> columns;
  for (std::size_t row = 0; row < 3; ++row) {
    for (std::size_t column = 0; column < 3; ++column) {
      const std::size_t turn = (row + 3 - column) % 3;
      const double cross = turn == 0 ? 0 : (turn == 1 ? n * s : -n * s);
      columns[column][row] = (row == column ? c : 0) + (1 - c) / 3 + cross;
    }
  }
  return columns;
}

template <class Io>
void write(const std::filesystem::path& path, const std::vector<std::int16_t>& samples,
           bool compressed) {
  const auto io = Io::New();
  io->SetFileName(path.string());
  io->SetNumberOfDimensions(3);
  io->SetComponentType(itk::IOComponentEnum::SHORT);
  io->SetPixelType(itk::IOPixelEnum::SCALAR);
  io->SetNumberOfComponents(1);
  io->SetUseCompression(compressed);
  itk::ImageIORegion region(3);
  const auto columns = oblique();
  for (unsigned axis = 0; axis < 3; ++axis) {
    io->SetDimensions(axis, kDims[axis]);
    io->SetSpacing(axis, 0.5 + axis);
    io->SetOrigin(axis, 10.25 * axis - 7);
    io->SetDirection(axis, std::vector<double>(columns[axis].begin(), columns[axis].end()));
    region.SetSize(axis, kDims[axis]);
  }
  io->SetIORegion(region);
  io->Write(samples.data());
}

void expect_near(const Geometry& geometry, const Geometry& expected, double rounding) {
  for (std::size_t at = 0; at < 3; ++at) {
    EXPECT_NEAR(geometry.origin[at], expected.origin[at], rounding);
    EXPECT_NEAR(geometry.spacing[at], expected.spacing[at], rounding);
  }
  for (std::size_t at = 0; at < 9; ++at) {
    EXPECT_NEAR(geometry.direction[at], expected.direction[at], rounding);
  }
}

template <class Io>
void expect_same_as_itk(ItkFormat format, const std::string& name, bool compressed) {
  const Folder folder;
  const auto samples = some_samples<std::int16_t>(60);
  const std::filesystem::path path = folder.path(name);
  write<Io>(path, samples, compressed);
  const Outcome outcome = import_bytes(read_file(path));
  ASSERT_EQ(outcome.error, "") << name;
  EXPECT_EQ(outcome.volume.dims, kDims) << name;
  EXPECT_EQ(samples_of<std::int16_t>(outcome), samples) << name;
  expect_near(outcome.volume.geometry, itk_geometry(format, path).value(), 1e-6);
}

TEST(Itk, AgreesAboutWhatItWrites) {
  expect_same_as_itk<itk::NiftiImageIO>(ItkFormat::kNifti, "volume.nii", false);
  expect_same_as_itk<itk::NiftiImageIO>(ItkFormat::kNifti, "volume.nii.gz", true);
  expect_same_as_itk<itk::NrrdImageIO>(ItkFormat::kNrrd, "volume.nrrd", false);
  expect_same_as_itk<itk::NrrdImageIO>(ItkFormat::kNrrd, "volume.nrrd", true);
  expect_same_as_itk<itk::MetaImageIO>(ItkFormat::kMetaImage, "volume.mha", false);
  expect_same_as_itk<itk::MetaImageIO>(ItkFormat::kMetaImage, "volume.mha", true);
}

// Both forms one after the other, so that each is judged alone.
TEST(Itk, AgreesAboutQformAndSform) {
  const Folder folder;
  const double half = std::sqrt(0.5);
  for (const NiftiFields& fields :
       {NiftiFields{.pixdim = {1, 2, 3, 4, 0, 0, 0, 0},
       .srow = {0, -3, 0, 5, 2, 0, 0, 6, 0, 0, 4, 7}},
        NiftiFields{.pixdim = {-1, 2, 3, 4, 0, 0, 0, 0},
        .qform_code = 1,
        .sform_code = 0,
        .quaternion = {half, 0, 0.5},
        .qoffset = {5, 6, 7}},
        NiftiFields{.pixdim = {1, 2, 3, 4, 0, 0, 0, 0}, .sform_code = 0}}) {
    const std::string bytes = nifti(fields, kSmallSamples);
    expect_near(import_bytes(bytes).volume.geometry,
                itk_geometry(ItkFormat::kNifti, folder.write("volume.nii", bytes)).value(), 1e-4);
  }
}

}  // namespace
}  // namespace isomesh::import::test
