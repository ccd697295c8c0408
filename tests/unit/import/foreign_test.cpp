// Tests of files by other programs that extend or violate the formats' descriptions.

#include <limits>
#include <tuple>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "tests/unit/import/archives.h"
#include "tests/unit/import/files.h"
#include "tests/unit/import/writers.h"

namespace isomesh::import::test {
namespace {

using testing::ElementsAre;
using testing::HasSubstr;
using testing::IsEmpty;
using testing::Not;
using Vector = std::array<double, 3>;

const std::string kSamples(kSmallSamples);

Lines without_space(Lines lines) {
  for (const char* name : {"space", "space directions", "space origin"}) {
    lines = with(lines, name, "");
  }
  return lines;
}

TEST(ForeignNrrd, ReadsBzip2AndItsDamage) {
  const Lines lines = with(small_nrrd(), "encoding", "bzip2");
  const std::string packed = bzip2(kSamples);
  EXPECT_EQ(import_bytes(nrrd(lines, packed)).sample_bytes(), kSamples);
  for (std::size_t size = 0; size < packed.size(); ++size) {
    EXPECT_FALSE(import_bytes(nrrd(lines, packed.substr(0, size))).imported()) << size;
  }
  EXPECT_FALSE(import_bytes(nrrd(lines, bzip2(kSamples + "x"))).imported());
  EXPECT_FALSE(import_bytes(nrrd(lines, packed + "x")).imported());
}

TEST(ForeignNrrd, SpacingFollowsFromMinsAndMaxs) {
  Lines lines = without_space(small_nrrd());
  lines.emplace_back("axis mins", "0 10 20");
  lines.emplace_back("axis maxs", "8 19 30");
  const Geometry cells = import_bytes(nrrd(lines, kSamples)).volume.geometry;
  EXPECT_EQ(cells.spacing, (Vector{2, 3, 5}));
  EXPECT_EQ(cells.origin, (Vector{1, 11.5, 22.5}));
  lines.emplace_back("centers", "node node node");
  EXPECT_THAT(import_bytes(nrrd(lines, kSamples)).volume.geometry.spacing,
              testing::Pointwise(testing::DoubleNear(1e-6), Vector{8.0 / 3, 4.5, 10}));
  EXPECT_FALSE(import_bytes(nrrd(with(lines, "axis maxs", "0 19 30"), kSamples)).imported());
}

TEST(ForeignNrrd, AnUnnamedSpaceOfFourDimensionsIsThatOfItsWriter) {
  Lines lines = without_space(small_nrrd());
  lines = with(with(lines, "dimension", "4"), "sizes", "4 3 2 1");
  lines.emplace_back("space dimension", "4");
  lines.emplace_back("space directions", "(-2,0,0,0) (0,-2,0,0) (0,0,3,0) (0,0,0,1)");
  lines.emplace_back("space origin", "(10,20,30,0)");
  const std::array<double, 9> identity = {1, 0, 0, 0, 1, 0, 0, 0, 1};
  const std::array<double, 9> turned = {-1, 0, 0, 0, -1, 0, 0, 0, 1};
  const auto with_pair = [&](const std::string& pair, const std::string& kinds = "") {
    std::string file = nrrd(with(lines, "kinds", kinds), kSamples);
    file.insert(file.find("\n\n") + 1, pair);
    const Outcome outcome = imported(import_bytes(file));
    EXPECT_THAT(codes_of(outcome), testing::Contains("space-assumed"));
    return outcome.volume.geometry;
  };
  const Geometry slicers = with_pair("Segment0_Name:=a\n");
  // Closed by a plane at each end.
  EXPECT_EQ(slicers.origin, (Vector{-12, -22, 27}));
  EXPECT_EQ(slicers.direction, identity);
  EXPECT_EQ(with_pair("Segment0_Extent:=5 8 1 3 2 3\n").origin, (Vector{0, -18, 36}));
  EXPECT_EQ(with_pair("Segmentation_Extent:=0 3 0 2 0 1\n", "domain domain domain domain").origin,
            (Vector{-10, -20, 30}));
  // ITK's is LPS, as in three dimensions.
  const Geometry itks = with_pair("", "domain domain domain domain");
  EXPECT_EQ(itks.origin, (Vector{10, 20, 30}));
  EXPECT_EQ(itks.direction, turned);
  // Others do not tell.
  const std::string file = nrrd(lines, kSamples);
  EXPECT_EQ(import_bytes(file).remedy.overridable, "space-assumed");
  const Outcome accepted = imported(import_bytes(file, {}, {.accept = {"space-assumed"}}));
  EXPECT_THAT(codes_of(accepted), ElementsAre("space-assumed"));
  EXPECT_EQ(accepted.volume.geometry, itks);
}

TEST(ForeignNrrd, AUnitThatCountsSamplesIsNoLength) {
  Lines lines = small_nrrd();
  lines.emplace_back("space units", "\"pixel\" \"pixel\" \"pixel\"");
  const Outcome outcome = import_bytes(nrrd(lines, kSamples));
  EXPECT_THAT(codes_of(outcome), ElementsAre("unit-unknown"));
}

// Sample by sample, as diffusion series are stored, and one behind the other.
TEST(ForeignNrrd, VolumesAreChosenAlongTheFirstAndTheLastAxis) {
  Lines lines = with(with(small_nrrd(), "dimension", "4"), "sizes", "3 2 2 2");
  lines = with(with(lines, "kinds", "list domain domain domain"), "space directions",
               "none (1,0,0) (0,1,0) (0,0,1)");
  EXPECT_THAT(import_bytes(nrrd(lines, kSamples)).error, HasSubstr("3 volumes"));
  std::string every_third;
  for (std::size_t at = 1; at < kSamples.size(); at += 3) every_third += kSamples[at];
  for (const bool packed : {false, true}) {
    const Lines encoded = with(lines, "encoding", packed ? "gzip" : "raw");
    const std::string file = nrrd(encoded, packed ? gzip(kSamples) : kSamples);
    EXPECT_EQ(import_bytes(file, {}, {.volume = 1}).sample_bytes(), every_third);
  }
  lines = with(with(lines, "sizes", "2 2 2 3"), "kinds", "domain domain domain list");
  lines = with(lines, "space directions", "(1,0,0) (0,1,0) (0,0,1) none");
  EXPECT_EQ(import_bytes(nrrd(lines, kSamples), {}, {.volume = 1}).sample_bytes(),
            kSamples.substr(8, 8));
}

// Volumes take turns with each row, or with each plane.
TEST(ForeignNrrd, VolumesAreChosenAlongAMiddleAxis) {
  Lines lines = with(with(small_nrrd(), "dimension", "4"), "sizes", "2 3 2 2");
  const auto second_of = [&](const std::string& kinds, const std::string& directions) {
    const Lines all = with(with(lines, "kinds", kinds), "space directions", directions);
    const std::string packed = nrrd(with(all, "encoding", "gzip"), gzip(kSamples));
    const std::string found(import_bytes(packed, {}, {.volume = 1}).sample_bytes());
    EXPECT_EQ(import_bytes(nrrd(all, kSamples), {}, {.volume = 1}).sample_bytes(), found);
    return found;
  };
  EXPECT_EQ(second_of("space list space space", "(1,0,0) none (0,1,0) (0,0,1)"), "cdijopuv");
  EXPECT_EQ(second_of("space space list space", "(1,0,0) (0,1,0) none (0,0,1)"), "ghijklstuvwx");
}

TEST(ForeignNrrd, ANiftiFileServesAsDataWithOrWithoutItsHeaderSkipped) {
  Lines lines = with(small_nrrd(), "encoding", "gzip");
  lines.emplace_back("data file", "h.nii.gz");
  const std::string data = gzip(nifti({}, kSamples));
  for (const char* skip : {"", "-1", "352"}) {
    const std::string header = nrrd(with(lines, "byte skip", skip), "");
    const Outcome outcome = import_bytes(zip({{"h.nhdr", header}, {"h.nii.gz", data}}));
    EXPECT_EQ(outcome.error, "") << skip;
    EXPECT_EQ(outcome.volume.format, "nrrd");
    EXPECT_EQ(outcome.sample_bytes(), kSamples);
    EXPECT_EQ(codes_of(outcome).size(), *skip == '\0' ? 1 : 0) << skip;
  }
}

TEST(ForeignMetaImage, RawDataMayBeALittleLonger) {
  const std::string header = metaimage(with(small_metaimage(), "ElementDataFile", "h.raw"), "");
  const Outcome outcome =
      import_bytes(zip({{"h.mhd", header}, {"h.raw", kSamples + "12 bytes more"}}));
  EXPECT_EQ(outcome.sample_bytes(), kSamples);
  EXPECT_THAT(codes_of(outcome), ElementsAre("trailing-bytes"));
}

TEST(ForeignMetaImage, SlopeAndOffsetAreApplied) {
  Lines lines = with(small_metaimage(), "ElementToIntensityFunctionSlope", "2");
  lines = with(lines, "ElementToIntensityFunctionOffset", "-5");
  const Outcome outcome = import_bytes(metaimage(lines, kSamples));
  EXPECT_EQ(outcome.volume.type, SampleType::kFloat32);
  EXPECT_EQ(samples_of<float>(outcome)[0], 'a' * 2.0F - 5);
  EXPECT_THAT(codes_of(outcome), ElementsAre("values-rescaled"));
}

TEST(ForeignPairs, AreReadWithTheirImage) {
  using std::string_literals::operator""s;
  const std::string header = nifti({.magic = "ni1\0"s, .vox_offset = 0}, "").substr(0, 348);
  for (const std::string& image : {kSamples, gzip(kSamples)}) {
    const std::string name = image == kSamples ? "v/a.img" : "v/a.img.gz";
    const Outcome outcome = imported(import_bytes(zip({{"v/a.hdr", header}, {name, image}})));
    EXPECT_EQ(outcome.sample_bytes(), kSamples);
    EXPECT_THAT(codes_of(outcome), IsEmpty());
  }
  const std::string version_2 = nifti({.version = 2, .magic = "ni2\0\r\n\032\n"s}, "");
  for (const std::string& alone : {header, version_2}) {
    EXPECT_THAT(import_bytes(alone).error, HasSubstr("in an .img file, which is missing"));
  }
  EXPECT_THAT(import_bytes(zip({{"a.hdr", header}, {"b.img", kSamples}})).error,
              HasSubstr("in an .img file, which is missing"));
  // The magic of a pair in a file that has its samples.
  const std::string whole = nifti({.magic = "ni1\0"s}, kSamples);
  for (const std::string& file : {whole, gzip(whole)}) {
    const Outcome outcome = imported(import_bytes(file));
    EXPECT_EQ(outcome.sample_bytes(), kSamples);
    EXPECT_THAT(codes_of(outcome), ElementsAre("header-corrected"));
  }
}

TEST(ForeignPairs, AnalyzeLiesAroundTheMiddleWithANote) {
  std::string header = nifti({.magic = std::string(4, '\0'),
                              .pixdim = {0, 2, 2, 3, 0, 0, 0, 0},
                              .vox_offset = 0,
                              .sform_code = 0},
                             "")
                           .substr(0, 348);
  header[38] = 'r';
  const Outcome outcome = imported(import_bytes(zip({{"a.hdr", header}, {"a.img", kSamples}})));
  EXPECT_EQ(outcome.volume.format, "nifti");
  EXPECT_EQ(outcome.sample_bytes(), kSamples);
  EXPECT_THAT(codes_of(outcome), ElementsAre("space-assumed"));
  EXPECT_EQ(outcome.volume.geometry.spacing, (Vector{2, 2, 3}));
  EXPECT_EQ(outcome.volume.geometry.origin, (Vector{-3, 2, -1.5}));
  EXPECT_THAT(outcome.volume.notes[0].detail, Not(HasSubstr("orient")));
  // SPM's origin, counted from 1; text of other programs is far from the volume.
  const auto with_origin = [&](const std::vector<std::int16_t>& origin) {
    std::string spms = header;
    spms.replace(253, origin.size() * 2, bytes_of(origin));
    return imported(import_bytes(zip({{"a.hdr", spms}, {"a.img", kSamples}}))).volume;
  };
  const Volume spms = with_origin({-3, 5, -1, 0, 0});
  EXPECT_EQ(spms.geometry.origin, (Vector{8, 8, 6}));
  EXPECT_EQ(spms.geometry.direction, outcome.volume.geometry.direction);
  EXPECT_THAT(spms.notes[0].detail, HasSubstr("where SPM's field \"originator\" has it"));
  for (const std::vector<std::int16_t>& text :
       {std::vector<std::int16_t>{0x4f4a, 0x4e48, 0, 0, 0}, std::vector<std::int16_t>{1, -3, 1}}) {
    EXPECT_EQ(with_origin(text).geometry, outcome.volume.geometry);
  }
  header[252] = 2;
  const Outcome sagittal = import_bytes(zip({{"a.hdr", header}, {"a.img", kSamples}}));
  EXPECT_EQ(sagittal.volume.geometry, outcome.volume.geometry);
  EXPECT_THAT(sagittal.volume.notes[0].detail, HasSubstr("2 (sagittal unflipped), was ignored"));
}

// nibabel, for one, leaves the field "regular" empty.
TEST(ForeignPairs, AnalyzeIsKnownWithoutRegular) {
  const auto header = [](const NiftiFields& fields) { return nifti(fields, "").substr(0, 348); };
  NiftiFields fields = {.magic = std::string(4, '\0'), .vox_offset = 0, .sform_code = 0};
  for (const bool big_endian : {false, true}) {
    fields.big_endian = big_endian;
    const Outcome outcome =
        imported(import_bytes(zip({{"a.hdr", header(fields)}, {"a.img", kSamples}})));
    EXPECT_EQ(outcome.sample_bytes(), kSamples);
    EXPECT_THAT(codes_of(outcome), ElementsAre("space-assumed"));
  }
  EXPECT_EQ(import_bytes(header(fields) + kSamples).code, ErrorCode::kUnsupportedMedia);
  NiftiFields other_bits = fields;
  other_bits.bitpix = 16;
  EXPECT_EQ(import_bytes(header(other_bits)).code, ErrorCode::kUnsupportedMedia);
  NiftiFields no_size = fields;
  no_size.dim[2] = 0;
  EXPECT_EQ(import_bytes(header(no_size)).code, ErrorCode::kUnsupportedMedia);
  EXPECT_EQ(import_bytes(header(fields).substr(0, 347)).code, ErrorCode::kUnsupportedMedia);
}

TEST(ForeignSamples, ThatAreNoNumbersAreOutside) {
  constexpr float kNan = std::numeric_limits<float>::quiet_NaN();
  constexpr float kInfinity = std::numeric_limits<float>::infinity();
  std::vector<float> samples = some_samples<float>(24);
  samples[0] = -1e12F;
  samples[3] = kNan;
  samples[7] = kInfinity;
  samples[9] = -kInfinity;
  const auto file = [](const std::vector<float>& values) {
    return nifti({.datatype = 16, .bitpix = 32}, bytes_of(values));
  };
  const Outcome outcome = import_bytes(file(samples));
  ASSERT_THAT(codes_of(outcome), ElementsAre("non-finite-samples"));
  EXPECT_THAT(outcome.volume.notes[0].detail, HasSubstr("3 of the 24"));
  EXPECT_EQ(outcome.volume.range[0], -1e12F);
  for (const std::size_t at : {3, 7, 9}) EXPECT_EQ(samples_of<float>(outcome)[at], -1e12F);
  EXPECT_EQ(samples_of<float>(outcome)[4], samples[4]);
  EXPECT_THAT(import_bytes(file(std::vector<float>(24, kNan))).error, HasSubstr("24 of the 24"));
}

TEST(ForeignSamples, OfFewWholeValuesInRegionsLookLikeLabels) {
  std::string labels;
  for (const char value : {0, 1, 2, 5}) labels += std::string(12, value);
  EXPECT_THAT(codes_of(import_bytes(nifti({.dim = {3, 6, 2, 4, 1, 1, 1, 1}}, labels))),
              ElementsAre("looks-like-labels"));
  EXPECT_THAT(codes_of(import_bytes(nifti({}, kSamples))), IsEmpty());
}

TEST(ForeignSamples, OfAMaskLookLikeOneLabel) {
  const auto outcome = [](const std::string& values, NiftiFields fields = {}) {
    std::string samples(24, values.front());
    for (std::size_t at = 5; at < 24; at += 7) samples[at] = values.back();
    return import_bytes(nifti(fields, samples));
  };
  const Outcome mask = outcome({'\0', '\xff'});
  ASSERT_THAT(codes_of(mask), ElementsAre("looks-like-labels"));
  EXPECT_THAT(mask.volume.notes[0].detail, HasSubstr("each is 0 or 255."));
  EXPECT_THAT(mask.volume.notes[0].detail, HasSubstr("\"labels\": \"all\""));
  EXPECT_THAT(codes_of(outcome({'\1', '\0'})), ElementsAre("looks-like-labels"));
  EXPECT_THAT(codes_of(outcome({'\1', '\2'})), IsEmpty());
  EXPECT_THAT(codes_of(outcome({'\0', '\0'})), IsEmpty());
  // Signed: the larger value is 0.
  EXPECT_THAT(codes_of(outcome({'\0', '\xff'}, {.datatype = 256})), IsEmpty());
}

// As nibabel and MONAI write masks: a job by labels rounds them.
TEST(ForeignSamples, OfAMaskOfFloatsStayFloats) {
  std::vector<float> samples(24, 0);
  samples[7] = samples[8] = 1;
  const Outcome mask = import_bytes(nifti({.datatype = 16, .bitpix = 32}, bytes_of(samples)));
  EXPECT_EQ(mask.volume.type, SampleType::kFloat32);
  EXPECT_EQ(samples_of<float>(mask), samples);
  ASSERT_THAT(codes_of(mask), ElementsAre("looks-like-labels"));
  EXPECT_THAT(mask.volume.notes[0].detail, HasSubstr("each is 0 or 1."));
  // A sample that is not a number is outside of the mask.
  samples[3] = std::numeric_limits<float>::quiet_NaN();
  const Outcome gap = import_bytes(nifti({.datatype = 16, .bitpix = 32}, bytes_of(samples)));
  EXPECT_EQ(gap.canonical, mask.canonical);
  EXPECT_THAT(codes_of(gap), ElementsAre("non-finite-samples", "looks-like-labels"));
  samples[3] = 0;
  // Labels without a background have one then.
  std::vector<float> labels(24, 2);
  labels[0] = labels[1] = std::numeric_limits<float>::quiet_NaN();
  const auto of = [](const std::vector<float>& values) {
    return imported(import_bytes(nifti({.datatype = 16, .bitpix = 32}, bytes_of(values))));
  };
  const Outcome outside = of(labels);
  EXPECT_THAT(codes_of(outside), ElementsAre("non-finite-samples", "looks-like-labels"));
  EXPECT_EQ(samples_of<float>(outside)[0], 0);
  EXPECT_EQ(samples_of<float>(outside)[2], 2);
  labels[5] = 2.5;
  EXPECT_EQ(samples_of<float>(of(labels))[0], 2) << "the smallest";
  samples[9] = 0.5;
  EXPECT_THAT(codes_of(import_bytes(nifti({.datatype = 16, .bitpix = 32}, bytes_of(samples)))),
              IsEmpty());
}

// Four regions of these values, as samples of the type.
template <class Number>
Outcome regions(const std::vector<Number>& values, NiftiFields fields = {}) {
  fields.dim = {3, 6, 2, 4, 1, 1, 1, 1};
  std::tie(fields.datatype, fields.bitpix) = nifti_type<Number>();
  std::vector<Number> samples;
  for (const Number value : values) samples.insert(samples.end(), 12, value);
  return import_bytes(nifti(fields, bytes_of(samples)));
}

TEST(ForeignSamples, ThatAreLabelsBecomeIntegers) {
  const Outcome bytes = regions<std::uint8_t>({0, 1, 2, 5});
  const Outcome floats = regions<float>({-0.0F, 1, 2, 5});
  EXPECT_EQ(floats.volume.type, SampleType::kUint8);
  EXPECT_EQ(floats.volume.range, bytes.volume.range);
  EXPECT_EQ(floats.volume.suggested_iso, bytes.volume.suggested_iso);
  EXPECT_EQ(floats.volume.bytes, 48U);
  EXPECT_EQ(floats.canonical, bytes.canonical);
  ASSERT_THAT(codes_of(floats), ElementsAre("looks-like-labels"));
  EXPECT_THAT(floats.volume.notes[0].detail,
              HasSubstr("The whole numbers, float32 in the file, are now uint8."));

  const Outcome doubles = regions<double>({-5, 0, 70'000, 3});
  EXPECT_EQ(doubles.volume.type, SampleType::kInt32);
  EXPECT_EQ(samples_of<std::int32_t>(doubles)[24], 70'000);
  const Outcome scaled = regions<std::uint16_t>({0, 1, 2, 5}, {.slope = 2});
  EXPECT_EQ(scaled.volume.type, SampleType::kUint8);
  EXPECT_EQ(samples_of<std::uint8_t>(scaled)[47], 10);
  EXPECT_THAT(scaled.volume.notes.back().detail, HasSubstr("float32"));
}

TEST(ForeignSamples, ThatAreNoLabelsStayFloats) {
  for (const std::vector<float>& values : std::vector<std::vector<float>>{
           {0, 1, 2, 2.5F}, {0, 1, 2, 1e10F}, {0, 1, 2, 1.002F}, {-1, 0, 1, 3e9F}}) {
    EXPECT_EQ(regions(values).volume.type, SampleType::kFloat32) << values[3];
  }
  std::vector<float> gradient(24);
  for (std::size_t at = 0; at < gradient.size(); ++at) gradient[at] = static_cast<float>(at);
  const Outcome outcome = import_bytes(nifti({.datatype = 16, .bitpix = 32}, bytes_of(gradient)));
  EXPECT_EQ(samples_of<float>(outcome), gradient);
}

TEST(ForeignSamples, ThatAreNearlyLabelsAreRounded) {
  // nibabel stores floats as scaled integers: -1, 0, 1 and 3 of a slope of a third, so to speak.
  const Outcome scaled = regions<double>({0, 0.99999999977, 2.9999999993, 0});
  EXPECT_EQ(scaled.volume.type, SampleType::kUint8);
  EXPECT_EQ(scaled.canonical, regions<std::uint8_t>({0, 1, 3, 0}).canonical);
  EXPECT_THAT(codes_of(scaled), ElementsAre("labels-rounded", "looks-like-labels"));
  EXPECT_THAT(scaled.volume.notes[0].detail, HasSubstr("stored as float64"));
  EXPECT_THAT(scaled.volume.notes[1].detail, HasSubstr("float64 in the file, are now uint8"));
  const Outcome two = regions<float>({1, 1, 2, 2.0005F});
  EXPECT_EQ(two.volume.type, SampleType::kFloat32) << "a job by labels rounds them";
  ASSERT_THAT(codes_of(two), ElementsAre("looks-like-labels"));
  EXPECT_THAT(two.volume.notes[0].detail, HasSubstr("2 different whole values"));
}

TEST(ForeignSamples, Of64BitsBecomeIntegersThatFit) {
  const Outcome labels = regions<std::int64_t>({0, 1, 2, 4'000'000'000});
  EXPECT_EQ(labels.volume.type, SampleType::kUint32);
  EXPECT_EQ(samples_of<std::uint32_t>(labels)[47], 4'000'000'000U);
  ASSERT_THAT(codes_of(labels), ElementsAre("looks-like-labels"));
  EXPECT_THAT(labels.volume.notes[0].detail, HasSubstr("64-bit integers in the file"));
  const Outcome mask = regions<std::uint64_t>({0, 0, 1, 1});
  EXPECT_EQ(mask.volume.type, SampleType::kUint8);
  ASSERT_THAT(codes_of(mask), ElementsAre("looks-like-labels"));
  EXPECT_THAT(mask.volume.notes[0].detail, HasSubstr("each is 0 or 1."));
  EXPECT_THAT(mask.volume.notes[0].detail, HasSubstr("64-bit integers in the file"));
}

// Segment ids of connectomics have more digits than a double.
TEST(ForeignSamples, Of64BitsThatDoNotFitAreNumberedLabels) {
  constexpr std::uint64_t kId = 720575940618780781;
  const Outcome ids = regions<std::uint64_t>({0, kId + 1, 3, kId});
  EXPECT_EQ(ids.volume.type, SampleType::kUint8);
  EXPECT_EQ(samples_of<std::uint8_t>(ids)[24], 1);
  EXPECT_EQ(samples_of<std::uint8_t>(ids)[12], 3);
  EXPECT_EQ(samples_of<std::uint8_t>(ids)[47], 2);
  EXPECT_THAT(codes_of(ids), ElementsAre("labels-renumbered", "looks-like-labels"));
  const std::vector<LabelEntry> entries = {{.label = 3, .values = {1}},
                                           {.label = std::int64_t{kId}, .values = {2}},
                                           {.label = std::int64_t{kId + 1}, .values = {3}}};
  EXPECT_EQ(ids.volume.labels, entries);

  constexpr std::int64_t kLow = std::numeric_limits<std::int64_t>::min();
  const Outcome negative = regions<std::int64_t>({0, kLow, 2, 1});
  EXPECT_EQ(negative.volume.labels.front(), (LabelEntry{.label = kLow, .values = {1}}));
  EXPECT_THAT(regions<std::uint64_t>({0, 1, 2, std::uint64_t{1} << 63}).error,
              HasSubstr("9223372036854775808 is too large"));
}

TEST(ForeignSamples, Of64BitsWithoutFlatRegionsAreNoLabels) {
  std::vector<std::int64_t> gradient(24);
  for (std::size_t at = 0; at < gradient.size(); ++at) {
    gradient[at] = std::int64_t{1} << (20 + at);
  }
  const Outcome outcome = import_bytes(nifti({.datatype = 1024, .bitpix = 64}, bytes_of(gradient)));
  EXPECT_EQ(outcome.volume.type, SampleType::kFloat64);
  EXPECT_EQ(samples_of<double>(outcome)[23], 0x1p43);
}

// Neither a signed nor an unsigned type of 32 bits has both.
TEST(ForeignSamples, Of64BitsOnBothSidesAreNumberedLabels) {
  const Outcome outcome = imported(regions<std::int64_t>({0, -1, 5, 3'000'000'000}));
  EXPECT_EQ(outcome.volume.type, SampleType::kUint8);
  EXPECT_THAT(
      outcome.volume.labels,
      ElementsAre(LabelEntry{.label = -1, .values = {1}}, LabelEntry{.label = 5, .values = {2}},
                  LabelEntry{.label = 3'000'000'000, .values = {3}}));
  EXPECT_THAT(outcome.volume.notes.back().detail,
              HasSubstr("The samples have 3 labels without a name"));
}

TEST(ForeignSamples, Of64BitsThatAreTooManyLabelsAreRefused) {
  std::vector<std::int64_t> ids;
  for (std::int64_t at = 0; at < std::int64_t{65'536} * 3; ++at) ids.push_back((at / 3 + 1) << 20);
  std::string file =
      nifti({.dim = {3, 256, 256, 3, 1, 1, 1, 1}, .datatype = 1024, .bitpix = 64}, bytes_of(ids));
  // An image, unless the header says otherwise.
  EXPECT_EQ(imported(import_bytes(file)).volume.type, SampleType::kFloat64);
  const std::int16_t intent = 1002;
  file.replace(68, sizeof(intent), reinterpret_cast<const char*>(&intent), sizeof(intent));
  EXPECT_THAT(import_bytes(file).error, HasSubstr("at most 65535"));
}

}  // namespace
}  // namespace isomesh::import::test
