// One object in files of several formats, in each order of axes: mostly one volume. Its places are
// numbers of single precision that nobody chose, so each file has its own errors of rounding.
#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <map>
#include <random>
#include <sstream>
#include <string>
#include <utility>
#include <vector>

#include <gtest/gtest.h>

#include "base/sha256.h"
#include "server/volume/geometry.h"
#include "tests/support/shapes.h"
#include "tests/support/storages.h"
#include "tests/unit/import/files.h"
#include "tests/unit/import/itk_reader.h"
#include "tests/unit/import/writers.h"

namespace isomesh::import::test {
namespace {

using isomesh::test::all_storages;
using isomesh::test::SampleVolume;
using isomesh::test::Storage;
using isomesh::test::stored_as;
using Object = SampleVolume<std::uint8_t>;
using Matrix = std::array<double, 9>;

// The rotation of a unit quaternion.
Matrix rotation(const std::array<double, 4>& q) {
  const auto& [a, b, c, d] = q;
  return {
      a * a + b * b - c * c - d * d, 2 * (b * c - a * d),           2 * (b * d + a * c),
      2 * (b * c + a * d),           a * a + c * c - b * b - d * d, 2 * (c * d - a * b),
      2 * (b * d - a * c),           2 * (c * d + a * b),           a * a + d * d - b * b - c * c};
}

// The unit quaternion of a rotation, with a real part that is not negative.
std::array<double, 4> quaternion(const Matrix& m) {
  const std::array<double, 4> squares = {1 + m[0] + m[4] + m[8], 1 + m[0] - m[4] - m[8],
                                         1 - m[0] + m[4] - m[8], 1 - m[0] - m[4] + m[8]};
  const auto largest = std::ranges::max_element(squares) - squares.begin();
  const std::array<std::array<double, 4>, 4> products = {
      {{squares[0], m[7] - m[5], m[2] - m[6], m[3] - m[1]},
       {m[7] - m[5], squares[1], m[1] + m[3], m[2] + m[6]},
       {m[2] - m[6], m[1] + m[3], squares[2], m[5] + m[7]},
       {m[3] - m[1], m[2] + m[6], m[5] + m[7], squares[3]}}};
  std::array<double, 4> q = products.at(static_cast<std::size_t>(largest));
  const double length = std::sqrt(q[0] * q[0] + q[1] * q[1] + q[2] * q[2] + q[3] * q[3]);
  for (double& part : q) part /= q[0] < 0 ? -length : length;
  return q;
}

// As nibabel makes it of an affine matrix, whose numbers it stores in single precision.
std::string as_sform(const Object& object) {
  NiftiFields fields;
  fields.dim = {3, object.dims.x, object.dims.y, object.dims.z, 1, 1, 1, 1};
  for (std::size_t row = 0; row < 3; ++row) {
    const double sign = row == 2 ? 1 : -1;  // LPS to RAS
    for (int axis = 0; axis < 3; ++axis) {
      fields.srow[row * 4 + static_cast<std::size_t>(axis)] =
          sign * step_of(object.geometry, axis)[row];
    }
    fields.srow[row * 4 + 3] = sign * object.geometry.origin[row];
  }
  for (std::size_t axis = 0; axis < 3; ++axis) {
    fields.pixdim[axis + 1] = object.geometry.spacing[axis];
  }
  return nifti(fields, bytes_of(object.samples));
}

std::string as_qform(const Object& object) {
  NiftiFields fields;
  fields.dim = {3, object.dims.x, object.dims.y, object.dims.z, 1, 1, 1, 1};
  fields.qform_code = 1;
  fields.sform_code = 0;
  Matrix ras = object.geometry.direction;
  for (std::size_t at = 0; at < 6; ++at) ras[at] = -ras[at];
  const double determinant = ras[0] * (ras[4] * ras[8] - ras[5] * ras[7]) -
                             ras[1] * (ras[3] * ras[8] - ras[5] * ras[6]) +
                             ras[2] * (ras[3] * ras[7] - ras[4] * ras[6]);
  if (determinant < 0) {
    fields.pixdim[0] = -1;
    for (std::size_t row = 0; row < 9; row += 3) ras[row + 2] = -ras[row + 2];
  }
  const std::array<double, 4> q = quaternion(ras);
  fields.quaternion = {q[1], q[2], q[3]};
  for (std::size_t axis = 0; axis < 3; ++axis) {
    fields.pixdim[axis + 1] = object.geometry.spacing[axis];
    fields.qoffset[axis] = (axis == 2 ? 1 : -1) * object.geometry.origin[axis];
  }
  return nifti(fields, bytes_of(object.samples));
}

std::string numbers(const std::vector<double>& all, int digits, char between) {
  std::ostringstream text;
  text.precision(digits);
  for (std::size_t at = 0; at < all.size(); ++at) {
    if (at > 0) text << between;
    text << all[at];
  }
  return text.str();
}

std::string sizes_of(const Object& object) {
  return numbers({static_cast<double>(object.dims.x), static_cast<double>(object.dims.y),
                  static_cast<double>(object.dims.z)},
                 9, ' ');
}

std::string as_nrrd(const Object& object, int digits) {
  const auto place = [&](const std::array<double, 3>& at) {
    return '(' + numbers({at.begin(), at.end()}, digits, ',') + ')';
  };
  const Geometry& geometry = object.geometry;
  return nrrd(
      {{"type", "uint8"},
       {"dimension", "3"},
       {"space", "left-posterior-superior"},
       {"sizes", sizes_of(object)},
       {"space directions", place(step_of(geometry, 0)) + ' ' + place(step_of(geometry, 1)) + ' ' +
                                place(step_of(geometry, 2))},
       {"endian", "little"},
       {"encoding", "raw"},
       {"space origin", place(geometry.origin)}},
      bytes_of(object.samples));
}

std::string as_metaimage(const Object& object, int digits) {
  const Geometry& geometry = object.geometry;
  std::vector<double> columns;
  for (std::size_t at = 0; at < 9; ++at) {
    columns.push_back(geometry.direction[at % 3 * 3 + at / 3]);
  }
  Lines lines = with(small_metaimage(), "TransformMatrix", numbers(columns, digits, ' '));
  lines =
      with(lines, "Offset", numbers({geometry.origin.begin(), geometry.origin.end()}, digits, ' '));
  lines = with(lines, "ElementSpacing",
               numbers({geometry.spacing.begin(), geometry.spacing.end()}, digits, ' '));
  return metaimage(with(lines, "DimSize", sizes_of(object)), bytes_of(object.samples));
}

std::string id_of(Outcome outcome) { return sha256_of(imported(std::move(outcome)).stored); }

std::string id_of_raw(const Object& object, const Geometry& geometry) {
  const RawDescription description = {.dims = {object.dims.x, object.dims.y, object.dims.z},
                                      .type = SampleType::kUint8,
                                      .geometry = geometry};
  return id_of(import_raw_bytes(bytes_of(object.samples), description));
}

// The lattice as a sform keeps it.
Geometry in_single_precision(const Geometry& geometry) {
  std::array<volume::Vector3, 3> steps;
  for (int axis = 0; axis < 3; ++axis) {
    steps.at(static_cast<std::size_t>(axis)) = step_of(geometry, axis);
  }
  volume::Vector3 origin = geometry.origin;
  for (auto* vector : {&origin, &steps[0], &steps[1], &steps[2]}) {
    for (double& number : *vector) number = static_cast<float>(number);
  }
  return volume::geometry_of(origin, steps);
}

// Objects whose lattices are not along the axes of the patient, about as large as a head.
std::vector<Object> objects() {
  std::vector<Object> all;
  std::mt19937 random(19);
  std::uniform_real_distribution<double> number(-1, 1);
  for (int at = 0; at < 12; ++at) {
    std::array<double, 4> q = {1, 0.3 * number(random), 0.3 * number(random), 0.3 * number(random)};
    const double length = std::sqrt(q[0] * q[0] + q[1] * q[1] + q[2] * q[2] + q[3] * q[3]);
    for (double& part : q) part /= length;
    Object object;
    object.dims = {181, 3, 217};
    object.geometry = in_single_precision(
        {.origin = {-90 + 20 * number(random), 50 * number(random), -100 + 20 * number(random)},
         .spacing = {1.1 + number(random) / 5, 1.1 + number(random) / 5, 1.1 + number(random) / 5},
         .direction = rotation(q)});
    object.samples = some_samples<std::uint8_t>(std::size_t{181} * 3 * 217);
    all.push_back(std::move(object));
  }
  return all;
}

struct Count {
  int same = 0;
  int all = 0;
};

TEST(OneVolume, IsMostlyThatOfAllFilesOfAnObject) {
  std::map<std::string, Count> counts;
  const Folder folder;
  for (const Object& object : objects()) {
    const std::string expected = id_of(import_bytes(as_sform(object)));
    const auto count = [&](const std::string& kind, const std::string& id) {
      ++counts[kind].all;
      if (id == expected) ++counts[kind].same;
    };
    int at = 0;
    for (const Storage& storage : all_storages()) {
      const Object stored = stored_as(object, storage);
      const std::string sform = as_sform(stored);
      const std::string id = id_of(import_bytes(sform));
      count("sform", id);
      // The Python package sends the affine matrix of nibabel, which has the numbers of the file.
      EXPECT_EQ(id_of_raw(stored, in_single_precision(stored.geometry)), id);
      count("nrrd 17", id_of(import_bytes(as_nrrd(stored, 17))));
      if (++at % 6 != 0) continue;
      count("qform", id_of(import_bytes(as_qform(stored))));
      for (const int digits : {8, 9, 12, 17}) {
        count("nrrd " + std::to_string(digits), id_of(import_bytes(as_nrrd(stored, digits))));
        count("mha " + std::to_string(digits), id_of(import_bytes(as_metaimage(stored, digits))));
      }
      const auto itk = itk_geometry(ItkFormat::kNifti, folder.write("stored.nii", sform));
      ASSERT_TRUE(itk);
      count("itk", id_of_raw(stored, *itk));
    }
  }
  // The rates that docs/decisions/order-of-axes.md tells, but for some luck.
  const std::map<std::string, double> least = {
      {"sform", 0.95},  {"nrrd 17", 0.95}, {"mha 17", 0.95}, {"nrrd 12", 0.95},
      {"mha 12", 0.95}, {"nrrd 9", 0.8},   {"mha 9", 0.8},   {"nrrd 8", 0.5},
      {"mha 8", 0.5},   {"itk", 0.6},      {"qform", 0.1}};
  for (const auto& [kind, share] : least) {
    EXPECT_GE(counts[kind].same, share * counts[kind].all) << kind << ": " << counts[kind].all;
    RecordProperty(kind,
                   std::to_string(counts[kind].same) + " of " + std::to_string(counts[kind].all));
  }
}

}  // namespace
}  // namespace isomesh::import::test
