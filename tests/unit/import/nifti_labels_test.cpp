// Labels in the extensions of NIfTI headers.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "tests/unit/import/files.h"
#include "tests/unit/import/writers.h"

namespace isomesh::import::test {
namespace {

using testing::Contains;
using testing::ElementsAre;
using testing::HasSubstr;
using testing::IsEmpty;

const std::string kSamples(24, '\1');

std::string extension(std::string text, std::int32_t code, bool big_endian) {
  text.resize((text.size() + 8 + 15) / 16 * 16 - 8, '\0');
  return bytes_of(std::vector{static_cast<std::int32_t>(text.size() + 8), code}, big_endian) + text;
}

// A file with some extensions, as they are.
std::string with_extensions(NiftiFields fields, const std::string& extensions,
                            const std::string& samples = kSamples) {
  const std::size_t header = fields.version == 1 ? 348 : 540;
  fields.vox_offset = static_cast<double>(header + 4 + extensions.size());
  const std::string flags("\1\0\0\0", 4);
  return nifti(fields, "").substr(0, header) + flags + extensions + samples;
}

std::string caret(const std::string& labels, const std::string& index = "0") {
  return R"(<?xml version="1.0" encoding="UTF-8"?><CaretExtension><Date><![CDATA[2013]]></Date>)"
         R"(<VolumeInformation Index=")" +
         index + R"("><LabelTable>)" + labels +
         "</LabelTable><VolumeType><![CDATA[Label]]></VolumeType></VolumeInformation>"
         "</CaretExtension>";
}

const std::string kTwo = R"(<Label Key="1" Red="1" Green="0.5" Blue="0" Alpha="1">)"
                         R"(<![CDATA[spleen]]></Label>)"
                         R"(<Label Key="7">left &amp; right</Label>)";

std::vector<LabelEntry> two() {
  return {{.label = 1, .name = "spleen", .color = "#ff8000"}, {.label = 7, .name = "left & right"}};
}

TEST(NiftiLabels, AreThoseOfCaret) {
  for (const int version : {1, 2}) {
    for (const bool big_endian : {false, true}) {
      const NiftiFields fields = {.version = version, .big_endian = big_endian};
      const std::string extensions =
          extension("a comment", 6, big_endian) + extension(caret(kTwo), 30, big_endian);
      const Outcome outcome = imported(import_bytes(with_extensions(fields, extensions)));
      EXPECT_EQ(outcome.volume.labels, two());
      EXPECT_EQ(outcome.sample_bytes(), kSamples);
      EXPECT_THAT(codes_of(outcome), Contains("looks-like-labels"));
    }
  }
  // TotalSegmentator gives its extension no code.
  EXPECT_EQ(import_bytes(gzip(with_extensions({}, extension(caret(kTwo), 0, false)))).volume.labels,
            two());
}

TEST(NiftiLabels, AreThoseOfTheVolume) {
  const std::string file =
      with_extensions({.dim = {4, 2, 3, 2, 2, 1, 1, 1}}, extension(caret(kTwo, "1"), 30, false));
  EXPECT_EQ(import_bytes(file, {}, {.volume = 1}).volume.labels, two());
  EXPECT_THAT(import_bytes(file, {}, {.volume = 0}).volume.labels, IsEmpty());
}

TEST(NiftiLabels, AreThoseOfAfni) {
  const std::string text =
      "<?xml version='1.0' ?><AFNI_attributes self_idcode=\"x\" ni_form=\"ni_group\" >"
      "<AFNI_atr ni_type=\"String\" atr_name=\"HISTORY_NOTE\" > \"&quot;1&quot; &quot;x&quot;\" "
      "</AFNI_atr>"
      "<AFNI_atr ni_type=\"String\" ni_dimen=\"123\" atr_name=\"VALUE_LABEL_DTABLE\" >"
      " \"&lt;VALUE_LABEL_DTABLE ni_type=&quot;2*String&quot; ni_dimen=&quot;2&quot; &gt;&#x0a;"
      " &quot;12&quot; &quot;Left-Thalamus&quot;&#x0a; &quot;3&quot; &quot;Cortex&quot;&#x0a;"
      "&lt;/VALUE_LABEL_DTABLE&gt;\" </AFNI_atr></AFNI_attributes>";
  const Outcome outcome = imported(import_bytes(with_extensions({}, extension(text, 4, false))));
  EXPECT_THAT(outcome.volume.labels, ElementsAre(LabelEntry{.label = 3, .name = "Cortex"},
                                                 LabelEntry{.label = 12, .name = "Left-Thalamus"}));
}

TEST(NiftiLabels, OfDamagedExtensionsAreNone) {
  const std::string doctype =
      "<!DOCTYPE a [<!ENTITY b \"c\">]>" + caret("<Label Key=\"1\">&b;</Label>").substr(38);
  const std::string lying = bytes_of(std::vector{std::int32_t{7}, std::int32_t{30}});
  const std::string too_long = bytes_of(std::vector{std::int32_t{1 << 30}, std::int32_t{30}});
  for (const std::string& extensions :
       {extension(caret(kTwo).substr(0, 200), 30, false), extension(doctype, 30, false),
        lying + caret(kTwo), too_long + caret(kTwo), std::string("\1"),
        extension("<LabelTable><Label Key=\"x\">a</Label></LabelTable>", 30, false)}) {
    const Outcome outcome = imported(import_bytes(with_extensions({}, extensions)));
    EXPECT_THAT(outcome.volume.labels, IsEmpty());
    EXPECT_EQ(outcome.sample_bytes(), kSamples);
  }
}

// The samples differ everywhere, so they do not look like labels.
TEST(NiftiLabels, AreDeclaredByTheIntent) {
  const auto of = [](const std::vector<float>& samples) {
    std::string file = nifti({.datatype = 16, .bitpix = 32}, bytes_of(samples));
    const std::int16_t intent = 1002;
    file.replace(68, sizeof(intent), reinterpret_cast<const char*>(&intent), sizeof(intent));
    return import_bytes(file);
  };
  std::vector<float> samples;
  for (int at = 0; at < 24; ++at) samples.push_back(static_cast<float>(at * 7 % 24));
  const Outcome whole = imported(of(samples));
  EXPECT_EQ(whole.volume.type, SampleType::kUint8);
  ASSERT_THAT(codes_of(whole), ElementsAre("looks-like-labels"));
  EXPECT_THAT(whole.volume.notes[0].detail, HasSubstr("says that its samples are labels"));
  EXPECT_THAT(whole.volume.notes[0].detail, HasSubstr("float32 in the file, are now uint8"));
  samples[3] = 0.5F;
  const Outcome fractions = of(samples);
  EXPECT_EQ(fractions.volume.type, SampleType::kFloat32);
  EXPECT_THAT(codes_of(fractions), IsEmpty());
}

TEST(NiftiLabels, OfFractionsAreNone) {
  const NiftiFields fields = {.datatype = 16, .bitpix = 32};
  const Outcome outcome = imported(import_bytes(with_extensions(
      fields, extension(caret(kTwo), 30, false), bytes_of(some_samples<float>(24)))));
  EXPECT_THAT(outcome.volume.labels, IsEmpty());
}

TEST(NiftiLabels, OfWholeNumbersAreKept) {
  const NiftiFields fields = {.datatype = 16, .bitpix = 32};
  std::vector<float> samples(24, 1);
  samples[5] = 7;
  const Outcome outcome = imported(
      import_bytes(with_extensions(fields, extension(caret(kTwo), 30, false), bytes_of(samples))));
  EXPECT_EQ(outcome.volume.type, SampleType::kUint8);
  EXPECT_EQ(outcome.volume.labels, two());
}

TEST(NiftiLabels, AreNotMoreThanSixteenBitsTellApart) {
  std::string labels;
  for (int at = 0; at < 66'000; ++at) labels += "<Label Key=\"" + std::to_string(at) + "\"/>";
  EXPECT_THAT(import_bytes(with_extensions({}, extension(caret(labels), 30, false))).error,
              HasSubstr("labels. At most 65535 are supported"));
}

}  // namespace
}  // namespace isomesh::import::test
