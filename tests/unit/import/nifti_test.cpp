#include <cmath>
#include <limits>
#include <numeric>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "base/base64.h"
#include "server/volume/geometry.h"
#include "tests/unit/import/archives.h"
#include "tests/unit/import/files.h"
#include "tests/unit/import/writers.h"

namespace isomesh::import::test {
namespace {

using testing::HasSubstr;

Outcome import_nifti(const NiftiFields& fields) {
  return import_bytes(nifti(fields, kSmallSamples));
}

Vector3 position(const Geometry& geometry, const Vector3& index) {
  Vector3 result = geometry.origin;
  for (int axis = 0; axis < 3; ++axis) {
    const Vector3 step = step_of(geometry, axis);
    for (std::size_t row = 0; row < 3; ++row) {
      result[row] += step[row] * index[static_cast<std::size_t>(axis)];
    }
  }
  return result;
}

void expect_near(const Vector3& one, const Vector3& other, double tolerance) {
  for (std::size_t row = 0; row < 3; ++row) EXPECT_NEAR(one[row], other[row], tolerance);
}

template <class Sample>
class NiftiOfType : public testing::Test {};
using Samples = testing::Types<std::uint8_t, std::int8_t, std::uint16_t, std::int16_t,
                               std::uint32_t, std::int32_t, float, double>;
TYPED_TEST_SUITE(NiftiOfType, Samples);

TYPED_TEST(NiftiOfType, IsReadInBothByteOrdersAndVersionsPlainAndCompressed) {
  const auto samples = some_samples<TypeParam>(24);
  NiftiFields fields;
  std::tie(fields.datatype, fields.bitpix) = nifti_type<TypeParam>();
  for (fields.version = 1; fields.version <= 2; ++fields.version) {
    for (const bool big_endian : {false, true}) {
      fields.big_endian = big_endian;
      const std::string file = nifti(fields, bytes_of(samples, big_endian));
      for (const std::string& bytes : {file, gzip(file)}) {
        const Outcome outcome = imported(import_bytes(bytes));
        EXPECT_EQ(outcome.volume.format, "nifti");
        EXPECT_EQ(outcome.volume.dims, (std::array<std::uint32_t, 3>{4, 3, 2}));
        EXPECT_EQ(samples_of<TypeParam>(outcome), samples);
      }
    }
  }
}

TEST(Nifti, Keeps64BitIntegersThatAreExactAndRefusesOthers) {
  NiftiFields fields{.datatype = 1024, .bitpix = 64};
  std::vector<std::int64_t> samples(24);
  std::iota(samples.begin(), samples.end(), -(std::int64_t{1} << 53));  // no flat regions
  samples[1] = std::numeric_limits<std::int64_t>::min();
  const Outcome outcome = import_bytes(nifti(fields, bytes_of(samples)));
  EXPECT_EQ(outcome.volume.type, SampleType::kFloat64);
  EXPECT_EQ(samples_of<double>(outcome)[0], -0x1p53);
  for (const std::int64_t bad :
       {(std::int64_t{1} << 53) + 1, std::numeric_limits<std::int64_t>::max()}) {
    samples[1] = bad;
    EXPECT_THAT(import_bytes(nifti(fields, bytes_of(samples))).error,
                HasSubstr(std::to_string(bad)));
  }
  fields.datatype = 1280;
  samples[1] = -1;
  EXPECT_THAT(import_bytes(nifti(fields, bytes_of(samples))).error,
              HasSubstr("18446744073709551615"));
}

TEST(Nifti, TurnsRasIntoLpsBySform) {
  const Outcome outcome = import_nifti(
      {.pixdim = {1, 2, 3, 4, 0, 0, 0, 0}, .srow = {2, 0, 0, 10, 0, 3, 0, 20, 0, 0, 4, 30}});
  EXPECT_EQ(outcome.volume.geometry.origin, (Vector3{-10, -20, 30}));
  EXPECT_EQ(outcome.volume.geometry.spacing, (Vector3{2, 3, 4}));
  EXPECT_EQ(outcome.volume.geometry.direction,
            (std::array<double, 9>{-1, 0, 0, 0, -1, 0, 0, 0, 1}));
}

// A quarter turn about z, from i to y; with qfac -1 the last axis points down.
TEST(Nifti, TurnsRasIntoLpsByQform) {
  const double half = std::sqrt(0.5);
  NiftiFields fields{.pixdim = {1, 2, 3, 4, 0, 0, 0, 0},
                     .qform_code = 1,
                     .sform_code = 0,
                     .quaternion = {0, 0, half},
                     .qoffset = {10, 20, 30}};
  const Geometry right = import_nifti(fields).volume.geometry;
  expect_near(right.origin, {-10, -20, 30}, 0);
  expect_near(step_of(right, 0), {0, -2, 0}, 1e-6);
  expect_near(step_of(right, 1), {3, 0, 0}, 1e-6);
  expect_near(step_of(right, 2), {0, 0, 4}, 1e-6);
  fields.pixdim[0] = -1;
  expect_near(step_of(import_nifti(fields).volume.geometry, 2), {0, 0, -4}, 1e-6);
  fields.quaternion = {0.8, 0.8, 0.8};
  EXPECT_THAT(import_nifti(fields).error, HasSubstr("not a rotation"));
}

// Half a turn: the real part of its quaternion is 0, but single precision of the others leaves
// 2.5e-4 of it. The C library of NIfTI drops that, too.
TEST(Nifti, TurnsByHalfATurnInSinglePrecision) {
  const NiftiFields fields{.pixdim = {1, 1, 1, 1, 0, 0, 0, 0},
                           .qform_code = 1,
                           .sform_code = 0,
                           .quaternion = {std::sqrt(0.5), std::sqrt(0.5), 0}};
  EXPECT_EQ(import_nifti(fields).volume.geometry.direction,
            (std::array<double, 9>{0, -1, 0, -1, 0, 0, 0, 0, -1}));
}

TEST(Nifti, LiesAlongLpsWithoutForms) {
  const Outcome outcome = import_nifti({.pixdim = {1, 2, 3, 4, 0, 0, 0, 0}, .sform_code = 0});
  EXPECT_EQ(outcome.volume.geometry, (Geometry{.spacing = {2, 3, 4}}));
  EXPECT_THAT(codes_of(outcome), testing::ElementsAre("space-assumed"));
}

TEST(Nifti, ValuesOfSurfacesAndMatricesAreNoVolumes) {
  const std::string row(2562, 'a');
  for (const std::vector<std::int64_t>& dim : std::vector<std::vector<std::int64_t>>{
           {3, 2562, 1, 1, 1, 1, 1, 1}, {3, 427, 1, 6, 1, 1, 1, 1}}) {
    EXPECT_THAT(import_bytes(nifti({.dim = dim}, row)).error,
                HasSubstr("2562 values in rows of one sample"));
  }
  std::string cifti = nifti({.version = 2}, kSmallSamples);
  cifti.replace(504, 4, bytes_of(std::vector<std::int32_t>{3001}));
  EXPECT_THAT(import_bytes(cifti).error, HasSubstr("CIFTI-2"));
}

TEST(Nifti, TakesTheSformWhateverItsCodeAndTellsHowFarTheQformIs) {
  for (const int code : {1, 2, 4}) {
    NiftiFields fields{.qform_code = 1, .sform_code = code, .qoffset = {3, 4, 12}};
    const Outcome outcome = import_nifti(fields);
    EXPECT_EQ(outcome.volume.geometry.origin, (Vector3{0, 0, 0}));
    ASSERT_EQ(codes_of(outcome), std::vector<std::string>{"forms-differ"});
    EXPECT_THAT(outcome.volume.notes[0].detail, HasSubstr("13.0 mm apart. The sform"));
    fields.qoffset = {0.001, 0, 0};
    EXPECT_EQ(codes_of(import_nifti(fields)), std::vector<std::string>{});
  }
}

TEST(Nifti, TakesTheFormThatIsAskedFor) {
  const NiftiFields fields{.qform_code = 1, .sform_code = 2, .qoffset = {3, 4, 12}};
  const std::string file = nifti(fields, kSmallSamples);
  const Outcome qform = import_bytes(file, {}, {.nifti_form = NiftiForm::kQform});
  EXPECT_EQ(qform.volume.geometry.origin, (Vector3{-3, -4, 12}));
  EXPECT_THAT(qform.volume.notes.at(0).detail, HasSubstr("The qform was used"));
  const Outcome sform = import_bytes(file, {}, {.nifti_form = NiftiForm::kSform});
  EXPECT_EQ(sform.volume.geometry.origin, (Vector3{0, 0, 0}));
  EXPECT_THAT(import_bytes(nifti({}, kSmallSamples), {}, {.nifti_form = NiftiForm::kQform}).error,
              HasSubstr("no qform"));
}

TEST(Nifti, ReadsAShearedSformAsItIs) {
  const double step = std::hypot(0.5, 2.0);
  const Outcome outcome = imported(import_nifti(
      {.pixdim = {1, 1, 1, step, 0, 0, 0, 0}, .srow = {1, 0, 0, 0, 0, 1, 0.5, 0, 0, 0, 2, 0}}));
  expect_near(position(outcome.volume.geometry, {1, 1, 1}), {-1, -1.5, 2}, 1e-6);
}

TEST(Nifti, ReadsAnSformFarFromTheOrigin) {
  const Outcome outcome = imported(
      import_nifti({.pixdim = {1, 0.865759, 0.865759, 1, 0, 0, 0, 0},
                    .srow = {0.865759, 0, 0, -221.2, 0, 0.865759, 0, -221.2, 0, 0, 1, -1755.25}}));
  EXPECT_EQ(outcome.volume.geometry.origin[2], -1755.25);
}

TEST(Nifti, NotesAnSformThatContradictsPixdim) {
  const Outcome outcome = import_nifti({.pixdim = {1, 1, 1, 2, 0, 0, 0, 0}});
  ASSERT_EQ(codes_of(outcome), std::vector<std::string>{"pixdim-differs"});
  EXPECT_THAT(outcome.volume.notes[0].detail, HasSubstr("along k: 2 in its pixdim"));
  EXPECT_EQ(outcome.volume.geometry.spacing, (Vector3{1, 1, 1}));
}

TEST(Nifti, HonoursItsSpatialUnit) {
  const std::vector<double> srow = {1, 0, 0, 10, 0, 1, 0, 20, 0, 0, 1, 30};
  const Geometry metres = import_nifti({.units = 1 + 8, .srow = srow}).volume.geometry;
  EXPECT_EQ(metres.spacing, (Vector3{1000, 1000, 1000}));
  EXPECT_EQ(metres.origin, (Vector3{-10000, -20000, 30000}));
  const Geometry microns =
      import_nifti({.units = 3, .qform_code = 1, .sform_code = 0, .qoffset = {10, 20, 30}})
          .volume.geometry;
  EXPECT_EQ(microns.spacing, (Vector3{0.001, 0.001, 0.001}));
  expect_near(microns.origin, {-0.01, -0.02, 0.03}, 1e-15);
  EXPECT_EQ(import_nifti({.units = 0}).volume.geometry.spacing, (Vector3{1, 1, 1}));
}

TEST(Nifti, AppliesSlopeAndIntercept) {
  const NiftiFields fields{.slope = 0.5, .intercept = -10};
  const Outcome outcome = import_nifti(fields);
  EXPECT_EQ(outcome.volume.type, SampleType::kFloat32);
  EXPECT_EQ(samples_of<float>(outcome)[0], 'a' * 0.5F - 10);
  EXPECT_EQ(outcome.volume.range[1], 'x' * 0.5 - 10);
}

TEST(Nifti, KeepsWideIntegersExactUnderASlope) {
  const std::vector<std::int32_t> samples(24, 2000000001);
  const Outcome outcome =
      import_bytes(nifti({.version = 2, .datatype = 8, .bitpix = 32, .slope = 0.5, .intercept = 1},
                         bytes_of(samples)));
  EXPECT_EQ(outcome.volume.type, SampleType::kFloat64);
  EXPECT_EQ(samples_of<double>(outcome)[0], 1000000001.5);
}

TEST(Nifti, TakesNoSlopeForNone) {
  const double nan = std::nan("");
  for (const NiftiFields& fields :
       {NiftiFields{.slope = 0, .intercept = 5}, NiftiFields{.slope = nan, .intercept = nan},
        NiftiFields{.slope = 1, .intercept = 0}}) {
    EXPECT_EQ(import_nifti(fields).volume.type, SampleType::kUint8);
  }
  EXPECT_EQ(import_nifti({.slope = 1, .intercept = 5}).volume.type, SampleType::kFloat32);
  EXPECT_THAT(import_nifti({.slope = 1, .intercept = nan}).error, HasSubstr("intercept nan"));
}

TEST(Nifti, OffersTheVolumesOfASeries) {
  const std::string file =
      nifti({.dim = {4, 2, 3, 2, 2, 1, 1, 1}, .pixdim = {1, 1, 1, 1, 2.5, 0, 0, 0}, .units = 10},
            kSmallSamples);
  for (const std::string& bytes : {file, gzip(file)}) {
    const Outcome open = import_bytes(bytes);
    EXPECT_THAT(open.error, HasSubstr("2 volumes that differ in time"));
    ASSERT_EQ(open.remedy.choices.size(), 2);
    EXPECT_EQ(open.remedy.choices[0].title, "0 s");
    EXPECT_EQ(open.remedy.choices[1].value, "1");
    EXPECT_EQ(open.remedy.choices[1].title, "2.5 s");
    const Outcome second = import_bytes(bytes, {}, {.volume = 1});
    EXPECT_EQ(second.sample_bytes(), kSmallSamples.substr(12));
    EXPECT_EQ(codes_of(second), std::vector<std::string>{"volume-chosen"});
    EXPECT_EQ(import_bytes(bytes, {}, {.volume = 0}).sample_bytes(), kSmallSamples.substr(0, 12));
    EXPECT_EQ(import_bytes(bytes, {}, {.volume = 2}).remedy.choices.size(), 2);
  }
  EXPECT_THAT(import_bytes(nifti({.dim = {5, 2, 2, 2, 1, 3, 1, 1}}, kSmallSamples)).error,
              HasSubstr("3 volumes that differ in dimension 5 (value)"));
  EXPECT_THAT(import_bytes(nifti({}, kSmallSamples), {}, {.volume = 1}).error,
              HasSubstr("only volume 0"));
}

std::vector<ChoicePicture> pictures_of(const std::string& bytes) {
  std::vector<ChoicePicture> pictures;
  for (const Choice& choice : import_bytes(bytes).remedy.choices) {
    if (choice.picture) pictures.push_back(*choice.picture);
  }
  return pictures;
}

std::vector<int> greys_of(const ChoicePicture& picture) {
  const auto bytes = from_base64(picture.grey).value();
  std::vector<int> greys;
  for (const auto byte : bytes) greys.push_back(static_cast<unsigned char>(byte));
  return greys;
}

// Two volumes of three slices, of which the middle ones have these samples.
std::string two_volumes(const std::string& first, const std::string& second, double along = 1) {
  const std::string empty(first.size(), '\0');
  return nifti(
      {.dim = {4, 3, 2, 3, 2, 1, 1, 1}, .srow = {along, 0, 0, 0, 0, along, 0, 0, 0, 0, 1, 0}},
      empty + first + empty + empty + second + empty);
}

TEST(Nifti, ShowsTheMiddleSliceOfEachVolumeOfASeries) {
  const std::string first({0, 0, 50, 100, 100, 100});
  const std::string second({100, 25, 0, 100, 127, 0});
  // The first axis leads to the right of the patient and the second to the front, as usual.
  const std::string file = two_volumes(first, second);
  for (const std::string& bytes : {file, gzip(file), zip({{"a.nii", file}})}) {
    const std::vector<ChoicePicture> pictures = pictures_of(bytes);
    ASSERT_EQ(pictures.size(), 2);
    EXPECT_EQ(pictures[0].width, 3);
    EXPECT_EQ(pictures[0].height, 2);
    EXPECT_THAT(greys_of(pictures[0]), testing::ElementsAre(255, 255, 255, 128, 0, 0));
    // By the window of the first.
    EXPECT_THAT(greys_of(pictures[1]), testing::ElementsAre(0, 255, 255, 0, 64, 255));
  }
  const std::string turned = two_volumes(first, second, -1);
  EXPECT_THAT(greys_of(pictures_of(turned).at(0)), testing::ElementsAre(0, 0, 128, 255, 255, 255));
}

TEST(Nifti, ShowsManyVolumesInSmallerPictures) {
  constexpr int kMany = 300;
  const NiftiFields fields = {.dim = {4, 100, 80, 2, kMany, 1, 1, 1}};
  const std::vector<ChoicePicture> pictures =
      pictures_of(nifti(fields, std::string(std::size_t{100} * 80 * 2 * kMany, 'x')));
  ASSERT_EQ(pictures.size(), kMany);
  EXPECT_EQ(pictures.back().width, 50);
  EXPECT_EQ(pictures.back().height, 40);
}

TEST(Nifti, AsksWithoutPicturesWhereTheFileEndsEarly) {
  const std::string file = two_volumes("abcdef", "ghijkl");
  const Outcome open = import_bytes(file.substr(0, file.size() - 1));
  EXPECT_EQ(open.remedy.choices.size(), 2);
  EXPECT_FALSE(open.remedy.choices.at(0).picture);
}

TEST(Nifti, OfFlatImagesInTimeIsNoVolume) {
  const std::string file = nifti({.dim = {4, 4, 3, 1, 2, 1, 1, 1}}, kSmallSamples);
  const Outcome refused = import_bytes(file);
  EXPECT_THAT(refused.error,
              HasSubstr("a sequence of 2 flat images of 4 x 3 samples along its fourth "
                        "dimension, time."));
  EXPECT_EQ(refused.remedy.overridable, "frames-as-slices");
  const Outcome accepted = imported(import_bytes(file, {}, {.accept = {"frames-as-slices"}}));
  EXPECT_EQ(accepted.volume.dims, (std::array<std::uint32_t, 3>{4, 3, 2}));
  EXPECT_EQ(accepted.sample_bytes(), kSmallSamples);
  EXPECT_THAT(codes_of(accepted), testing::ElementsAre("frames-as-slices"));
  EXPECT_THAT(import_bytes(file, {}, {.volume = 1}).error, HasSubstr("flat image"));
}

TEST(Nifti, FlatImagesOfValuesAreNoInstants) {
  const NiftiFields fields = {.dim = {5, 4, 3, 1, 1, 2, 1, 1}};
  const Outcome refused = import_bytes(nifti(fields, kSmallSamples));
  EXPECT_THAT(refused.error,
              AllOf(HasSubstr("along its fifth dimension, of values"), Not(HasSubstr("time"))));
  EXPECT_EQ(refused.remedy.overridable, "frames-as-slices");
  // A flat field of vectors, NIFTI_INTENT_VECTOR.
  std::string vectors = nifti(fields, kSmallSamples);
  vectors.replace(68, 2, bytes_of(std::vector<std::int16_t>{1007}));
  const Outcome field = import_bytes(vectors);
  EXPECT_THAT(field.error, HasSubstr("flat image"));
  EXPECT_EQ(field.remedy.overridable, "");
  EXPECT_TRUE(field.remedy.choices.empty());
}

TEST(Nifti, PassesOverDimensionsOfOne) {
  EXPECT_TRUE(import_nifti({.dim = {7, 4, 3, 2, 1, 1, 1, 1}}).imported());
  // Sizes beyond the stated number of dimensions are ignored.
  EXPECT_TRUE(import_nifti({.dim = {3, 4, 3, 2, 0, -5, 9, 0}}).imported());
}

TEST(Nifti, RefusesSizesThatCannotBe) {
  for (const std::int64_t bad : {0, -1, -32768}) {
    EXPECT_EQ(import_nifti({.dim = {3, 4, bad, 2, 1, 1, 1, 1}}).code, ErrorCode::kUnusableVolume);
  }
  for (const std::int64_t bad : {-1, 0, 8, 300}) {
    EXPECT_THAT(import_nifti({.dim = {bad, 4, 3, 2, 1, 1, 1, 1}}).error, HasSubstr("dimensions"));
  }
  const std::int64_t huge = std::int64_t{1} << 40;
  EXPECT_THAT(import_nifti({.version = 2, .dim = {3, huge, huge, huge, 1, 1, 1, 1}}).error,
              HasSubstr("not plausible"));
  EXPECT_THAT(import_nifti({.dim = {3, 32767, 32767, 32767, 1, 1, 1, 1}}).error,
              HasSubstr("truncated"));
}

TEST(Nifti, RefusesSpacingsThatCannotBe) {
  for (const double bad : {std::nan(""), std::numeric_limits<double>::infinity()}) {
    NiftiFields fields;
    fields.pixdim[2] = bad;
    // The sform needs no voxel sizes.
    EXPECT_EQ(codes_of(import_nifti(fields)), std::vector<std::string>{"pixdim-differs"});
    fields.sform_code = 0;
    const Outcome outcome = import_nifti(fields);
    EXPECT_EQ(outcome.code, ErrorCode::kUnusableVolume);
    EXPECT_THAT(outcome.error, HasSubstr("voxel size along j"));
  }
}

TEST(Nifti, RefusesFormsThatCannotBe) {
  for (std::size_t axis = 0; axis < 3; ++axis) {
    NiftiFields fields;
    for (std::size_t row = 0; row < 3; ++row) fields.srow[4 * row + axis] = 0;
    EXPECT_EQ(import_nifti(fields).code, ErrorCode::kUnusableVolume);
  }
  EXPECT_FALSE(import_nifti({.srow = {0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0}}).imported());
  EXPECT_FALSE(import_nifti({.srow = {1, 1, 0, 0, 0, 0, 0, 0, 0, 0, 1, 0}}).imported());
  NiftiFields fields{.qform_code = 1, .sform_code = 0};
  fields.quaternion[1] = std::nan("");
  EXPECT_FALSE(import_nifti(fields).imported());
  EXPECT_THAT(import_nifti({.srow = {1, 0, 0, 9e6, 0, 1, 0, 0, 0, 0, 1, 0}}).error,
              HasSubstr("single precision"));
}

TEST(Nifti, RefusesTypesThatAreNoNumbersByName) {
  EXPECT_THAT(import_nifti({.datatype = 32, .bitpix = 64}).error, HasSubstr("complex"));
  EXPECT_THAT(import_nifti({.datatype = 128, .bitpix = 24}).error, HasSubstr("RGB24"));
  EXPECT_THAT(import_nifti({.datatype = 1536, .bitpix = 128}).error, HasSubstr("float128"));
  EXPECT_THAT(import_nifti({.datatype = 77, .bitpix = 8}).error, HasSubstr("77"));
  EXPECT_THAT(import_nifti({.datatype = 0, .bitpix = 8}).error, HasSubstr("datatype 0"));
}

TEST(Nifti, FindsItsSamplesBehindExtensions) {
  const std::string file =
      nifti({.vox_offset = 400}, std::string(48, 'E') + "abcdefghijklmnopqrstuvwx");
  EXPECT_EQ(import_bytes(file).sample_bytes(), kSmallSamples);
  for (const double bad : {347.0, 1e30, std::nan("")}) {
    EXPECT_FALSE(import_nifti({.vox_offset = bad}).imported()) << bad;
  }
}

// As nibabel and ITK read these, or one of both.
TEST(Nifti, CorrectsFieldsThatMeanNothing) {
  const double infinity = std::numeric_limits<double>::infinity();
  const Outcome right = import_nifti({});
  const auto is_corrected = [&](const NiftiFields& fields, const std::string& detail) {
    const Outcome outcome = imported(import_nifti(fields));
    EXPECT_EQ(outcome.canonical, right.canonical) << detail;
    EXPECT_EQ(codes_of(outcome), std::vector<std::string>{"header-corrected"}) << detail;
    EXPECT_THAT(outcome.volume.notes[0].detail, HasSubstr(detail));
  };
  for (const int version : {1, 2}) {
    is_corrected({.version = version, .bitpix = 16}, "Its bitpix is 16, but its datatype 2 has 8");
    is_corrected({.version = version, .slope = infinity}, "Its slope is inf");
    is_corrected({.version = version, .slope = -infinity}, "Its slope is -inf");
    is_corrected({.version = version, .units = 5}, "Its spatial unit 5 is unknown");
    is_corrected({.version = version, .units = 15}, "Its spatial unit 7 is unknown");
    is_corrected({.version = version, .dim = {5, 4, 3, 2, 0, 0, 1, 1}}, "along axis 5 is 0");
    is_corrected({.version = version, .vox_offset = 0}, "Its vox_offset is 0");
  }
  is_corrected({.vox_offset = 352.5}, "Its vox_offset is 352.5");
  EXPECT_THAT(codes_of(import_nifti({.bitpix = 0})), testing::IsEmpty());
}

TEST(Nifti, TakesNegativeSizesOfVoxelsForTheirAmount) {
  for (const auto& [said, read] : {std::pair(-2.0, 2.0), std::pair(0.0, 1.0)}) {
    NiftiFields fields{.qform_code = 1, .sform_code = 0};
    fields.pixdim[2] = said;
    const Outcome outcome = imported(import_nifti(fields));
    EXPECT_EQ(outcome.volume.geometry.spacing, (Vector3{1, read, 1}));
    EXPECT_EQ(codes_of(outcome), std::vector<std::string>{"header-corrected"});
    EXPECT_THAT(outcome.volume.notes[0].detail, HasSubstr("The voxel size along j is"));
    fields.pixdim[2] = read;
    EXPECT_EQ(outcome.volume.geometry, import_nifti(fields).volume.geometry);
    // The sform needs no voxel sizes.
    fields.pixdim[2] = said;
    fields.sform_code = 1;
    EXPECT_EQ(codes_of(import_nifti(fields)), std::vector<std::string>{"pixdim-differs"});
  }
}

TEST(Nifti, IsKnownWithAnotherSizeOfItsHeader) {
  for (const bool big_endian : {false, true}) {
    std::string file = nifti({.big_endian = big_endian}, kSmallSamples);
    file.replace(0, 4, std::string(4, '\0'));
    const Outcome outcome = imported(import_bytes(file));
    EXPECT_EQ(outcome.canonical, import_nifti({}).canonical);
    EXPECT_EQ(codes_of(outcome), std::vector<std::string>{"header-corrected"});
    file.replace(344, 4, std::string(4, '\0'));
    EXPECT_EQ(import_bytes(file).code, ErrorCode::kUnsupportedMedia);
  }
}

TEST(Nifti, OffersTheQformInPlaceOfAnSformOfNothing) {
  NiftiFields fields{.qform_code = 1, .qoffset = {10, 20, 30}, .srow = std::vector(12, 0.0)};
  const Outcome refused = import_nifti(fields);
  EXPECT_EQ(refused.code, ErrorCode::kUnusableVolume);
  ASSERT_EQ(refused.remedy.choices.size(), 1);
  EXPECT_EQ(refused.remedy.choices[0].parameter, "nifti_form");
  EXPECT_EQ(refused.remedy.choices[0].value, "qform");
  const Outcome chosen =
      imported(import_bytes(nifti(fields, kSmallSamples), {}, {.nifti_form = NiftiForm::kQform}));
  EXPECT_EQ(chosen.volume.geometry.origin, (Vector3{-10, -20, 30}));
  EXPECT_THAT(codes_of(chosen), testing::IsEmpty());
  fields.qform_code = 0;
  EXPECT_THAT(import_nifti(fields).remedy.choices, testing::IsEmpty());
}

TEST(Nifti, IgnoresAnInterceptWithoutASlopeWithANote) {
  for (const double slope : {0.0, std::nan("")}) {
    const Outcome outcome = imported(import_nifti({.slope = slope, .intercept = 5}));
    EXPECT_EQ(outcome.canonical, import_nifti({}).canonical);
    EXPECT_EQ(codes_of(outcome), std::vector<std::string>{"rescale-ignored"});
    EXPECT_THAT(outcome.volume.notes[0].detail, HasSubstr("an intercept of 5"));
  }
}

TEST(Nifti, RefusesMoreThanTheLimits) {
  const std::string file = nifti({.slope = 2}, kSmallSamples);
  EXPECT_EQ(import_bytes(file, {.max_sample_bytes = 95}).code, ErrorCode::kTooLarge);
  EXPECT_EQ(import_bytes(gzip(file), {.max_sample_bytes = 95}).code, ErrorCode::kTooLarge);
  EXPECT_TRUE(import_bytes(file, {.max_sample_bytes = 96}).imported());
}

}  // namespace
}  // namespace isomesh::import::test
