// Random small volumes in every format, type, byte order and axis order come back exactly.

#include <random>
#include <sstream>

#include <gtest/gtest.h>

#include "server/volume/geometry.h"
#include "tests/unit/import/archives.h"
#include "tests/unit/import/files.h"
#include "tests/unit/import/vti_writer.h"
#include "tests/unit/import/writers.h"

namespace isomesh::import::test {
namespace {

constexpr int kVolumesPerType = 12;

// What a type is called in each format.
struct Names {
  SampleType type;
  std::string nrrd;
  std::string metaimage;
  std::string vtk;
};

template <class Sample>
Names names_of();
template <>
Names names_of<std::uint8_t>() {
  return {SampleType::kUint8, "uchar", "MET_UCHAR", "UInt8"};
}
template <>
Names names_of<std::int8_t>() {
  return {SampleType::kInt8, "signed char", "MET_CHAR", "Int8"};
}
template <>
Names names_of<std::uint16_t>() {
  return {SampleType::kUint16, "ushort", "MET_USHORT", "UInt16"};
}
template <>
Names names_of<std::int16_t>() {
  return {SampleType::kInt16, "short", "MET_SHORT", "Int16"};
}
template <>
Names names_of<std::uint32_t>() {
  return {SampleType::kUint32, "uint", "MET_UINT", "UInt32"};
}
template <>
Names names_of<std::int32_t>() {
  return {SampleType::kInt32, "int", "MET_INT", "Int32"};
}
template <>
Names names_of<float>() {
  return {SampleType::kFloat32, "float", "MET_FLOAT", "Float32"};
}
template <>
Names names_of<double>() {
  return {SampleType::kFloat64, "double", "MET_DOUBLE", "Float64"};
}

template <class Sample>
struct RandomVolume {
  std::array<std::uint32_t, 3> dims = {};
  std::array<Vector3, 3> steps = {};  // along i, j and k, in LPS
  Vector3 origin = {};
  std::vector<Sample> samples;

  explicit RandomVolume(std::mt19937& random) {
    std::array<std::size_t, 3> axes = {0, 1, 2};
    std::shuffle(axes.begin(), axes.end(), random);
    const auto number = [&](int low, int high) {
      return std::uniform_int_distribution<int>(low, high)(random);
    };
    for (std::size_t axis = 0; axis < 3; ++axis) {
      dims[axis] = static_cast<std::uint32_t>(number(1, 6));
      steps[axis][axes[axis]] = number(1, 12) * 0.25 * (number(0, 1) == 0 ? 1 : -1);
      origin[axis] = number(-400, 400) * 0.5;
    }
    samples = some_samples<Sample>(count() + static_cast<std::size_t>(number(0, 1000)));
    samples.erase(samples.begin(), samples.end() - static_cast<std::ptrdiff_t>(count()));
  }

  std::size_t count() const { return std::size_t{dims[0]} * dims[1] * dims[2]; }
  double spacing(std::size_t axis) const {
    const Vector3& s = steps[axis];
    return std::abs(s[0]) + std::abs(s[1]) + std::abs(s[2]);  // one of them is not 0
  }
  double direction(std::size_t row, std::size_t axis) const {
    return steps[axis][row] / spacing(axis);
  }
};

template <class... Numbers>
std::string text_of(const Numbers&... numbers) {
  std::ostringstream text;
  text.precision(17);
  ((text << +numbers << ' '), ...);
  return text.str();
}

template <class Sample>
std::string samples_text(const RandomVolume<Sample>& volume) {
  std::string text;
  for (const Sample sample : volume.samples) text += text_of(sample);
  return text;
}

template <class Sample>
std::string as_nifti(const RandomVolume<Sample>& v, int version, bool big_endian) {
  const auto [code, bits] = nifti_type<Sample>();
  NiftiFields fields{
      .version = version, .big_endian = big_endian, .datatype = code, .bitpix = bits};
  for (std::size_t axis = 0; axis < 3; ++axis) {
    fields.dim[axis + 1] = v.dims[axis];
    fields.pixdim[axis + 1] = v.spacing(axis);
    // RAS
    fields.srow[axis] = -v.steps[axis][0];
    fields.srow[4 + axis] = -v.steps[axis][1];
    fields.srow[8 + axis] = v.steps[axis][2];
  }
  fields.srow[3] = -v.origin[0];
  fields.srow[7] = -v.origin[1];
  fields.srow[11] = v.origin[2];
  return nifti(fields, bytes_of(v.samples, big_endian));
}

template <class Sample>
Lines nrrd_lines(const RandomVolume<Sample>& v, bool big_endian, const std::string& encoding) {
  const auto vector = [](const Vector3& s) {
    std::string text = text_of(s[0]) + "," + text_of(s[1]) + "," + text_of(s[2]);
    std::erase(text, ' ');
    return "(" + text + ")";
  };
  Lines lines = with(small_nrrd(), "type", names_of<Sample>().nrrd);
  lines = with(lines, "sizes", text_of(v.dims[0], v.dims[1], v.dims[2]));
  lines = with(lines, "space directions",
               vector(v.steps[0]) + " " + vector(v.steps[1]) + " " + vector(v.steps[2]));
  lines = with(lines, "space origin", vector(v.origin));
  lines = with(lines, "endian", big_endian ? "big" : "little");
  return with(lines, "encoding", encoding);
}

template <class Sample>
Lines metaimage_lines(const RandomVolume<Sample>& v, bool big_endian) {
  Lines lines = with(small_metaimage(), "ElementType", names_of<Sample>().metaimage);
  lines = with(lines, "DimSize", text_of(v.dims[0], v.dims[1], v.dims[2]));
  lines = with(lines, "Offset", text_of(v.origin[0], v.origin[1], v.origin[2]));
  lines = with(lines, "ElementSpacing", text_of(v.spacing(0), v.spacing(1), v.spacing(2)));
  std::string matrix;
  for (std::size_t axis = 0; axis < 3; ++axis) {
    for (std::size_t row = 0; row < 3; ++row) matrix += text_of(v.direction(row, axis));
  }
  lines = with(lines, "TransformMatrix", matrix);
  return with(lines, "BinaryDataByteOrderMSB", big_endian ? "True" : "False");
}

template <class Sample>
VtiFields vti_fields(const RandomVolume<Sample>& v, VtiForm form, bool big_endian,
                     bool compressed) {
  VtiFields fields{.form = form, .type = names_of<Sample>().vtk};
  fields.big_endian = big_endian;
  fields.compressed = compressed;
  fields.wide_header = v.dims[0] % 2 == 0;
  fields.block_bytes = sizeof(Sample) * (1 + v.dims[1]);
  fields.extent.clear();
  fields.direction.clear();
  Vector3 origin = v.origin;
  for (std::size_t axis = 0; axis < 3; ++axis) {
    const int first = static_cast<int>(v.dims[axis]) - 3;
    fields.extent += text_of(first, first + static_cast<int>(v.dims[axis]) - 1);
    for (std::size_t row = 0; row < 3; ++row) origin[row] -= v.steps[axis][row] * first;
  }
  for (std::size_t row = 0; row < 3; ++row) {
    for (std::size_t axis = 0; axis < 3; ++axis)
      fields.direction += text_of(v.direction(row, axis));
  }
  fields.origin = text_of(origin[0], origin[1], origin[2]);
  fields.spacing = text_of(v.spacing(0), v.spacing(1), v.spacing(2));
  return fields;
}

// The volume in every form that depends on the byte order.
template <class Sample>
std::vector<std::string> binary_files(const RandomVolume<Sample>& v, bool big_endian) {
  const std::string raw = bytes_of(v.samples, big_endian);
  const Lines mha = metaimage_lines(v, big_endian);
  const Lines packed = with(mha, "CompressedData", "True");
  const std::string mhd = metaimage(with(mha, "ElementDataFile", "v.raw"), "");
  const Lines raw_nrrd = nrrd_lines(v, big_endian, "raw");
  const std::string nhdr = nrrd(with(raw_nrrd, "data file", "v.raw"), "");
  std::vector<std::string> files = {as_nifti(v, 1, big_endian),
                                    as_nifti(v, 2, big_endian),
                                    gzip(as_nifti(v, 1, big_endian)),
                                    nrrd(raw_nrrd, raw),
                                    nrrd(nrrd_lines(v, big_endian, "gzip"), gzip(raw)),
                                    metaimage(mha, raw),
                                    metaimage(packed, zlib(raw)),
                                    zip({{"v.mhd", mhd}, {"v.raw", raw}}),
                                    tar({{"v.raw", raw}, {"v.mhd", mhd}}),
                                    gzip(tar({{"v.nhdr", nhdr}, {"v.raw", raw}})),
                                    zip({{"v.nii.gz", gzip(as_nifti(v, 2, big_endian))}})};
  for (const VtiForm form : {VtiForm::kBinary, VtiForm::kAppendedRaw, VtiForm::kAppendedBase64}) {
    for (const bool compressed : {false, true}) {
      files.push_back(vti(vti_fields(v, form, big_endian, compressed), raw));
    }
  }
  return files;
}

template <class Sample>
std::vector<std::string> text_files(const RandomVolume<Sample>& v) {
  const std::string text = samples_text(v);
  return {nrrd(nrrd_lines(v, false, "ascii"), text),
          metaimage(with(metaimage_lines(v, false), "BinaryData", "False"), text),
          vti(vti_fields(v, VtiForm::kAscii, false, false), text)};
}

template <class Sample>
void expect_same(const Outcome& outcome, const RandomVolume<Sample>& v, std::size_t number) {
  ASSERT_EQ(outcome.error, "") << number;
  EXPECT_EQ(outcome.volume.type, names_of<Sample>().type) << number;
  EXPECT_EQ(outcome.volume.dims, v.dims) << number;
  EXPECT_EQ(samples_of<Sample>(outcome), v.samples) << number;
  EXPECT_EQ(outcome.volume.geometry.origin, v.origin) << number;
  for (int axis = 0; axis < 3; ++axis) {
    EXPECT_EQ(step_of(outcome.volume.geometry, axis), v.steps[static_cast<std::size_t>(axis)])
        << number;
  }
}

template <class Sample>
class EveryType : public testing::Test {};

using Types = testing::Types<std::uint8_t, std::int8_t, std::uint16_t, std::int16_t, std::uint32_t,
                             std::int32_t, float, double>;
TYPED_TEST_SUITE(EveryType, Types);

TYPED_TEST(EveryType, ComesBackExactlyFromEveryFormat) {
  std::mt19937 random(20261120);
  for (int round = 0; round < kVolumesPerType; ++round) {
    const RandomVolume<TypeParam> volume(random);
    std::vector<std::string> files = text_files(volume);
    for (const bool big_endian : {false, true}) {
      const auto more = binary_files(volume, big_endian);
      files.insert(files.end(), more.begin(), more.end());
    }
    for (std::size_t at = 0; at < files.size(); ++at) {
      expect_same(import_bytes(files[at]), volume, at);
    }
  }
}

}  // namespace
}  // namespace isomesh::import::test
