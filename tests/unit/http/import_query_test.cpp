#include "server/http/requests/import_query.h"

#include <string>
#include <utility>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "tests/support/errors.h"
#include "tests/unit/http/requests.h"

namespace isomesh::http {
namespace {

using test::code_thrown_by;
using test::error_of;
using test::fields_of;
using test::with_query;
using testing::ElementsAre;
using testing::UnorderedElementsAre;
using Pairs = std::vector<std::pair<std::string, std::string>>;

TEST(RawDescription, IsNoneWithoutDims) { EXPECT_FALSE(raw_description_of(Request())); }

TEST(RawDescription, WhatIsMalformedIsRefusedByName) {
  for (const auto& [name, value] : Pairs{{"dims", ""},
                                         {"dims", "3,4"},
                                         {"dims", "3,4,5,6"},
                                         {"dims", "3,4,-5"},
                                         {"dims", "3,4,5.5"},
                                         {"dims", "3,4,4294967296"},
                                         {"dims", "a,b,c"},
                                         {"dims", "3,,5"},
                                         {"type", ""},
                                         {"type", "int64"},
                                         {"type", "UINT8"},
                                         {"spacing", "1,1"},
                                         {"spacing", "1,1,x"},
                                         {"origin", "0"},
                                         {"direction", "1,0,0,0,1,0,0,0"},
                                         {"byte_order", "middle"},
                                         {"byte_order", ""}}) {
    Pairs query = {{"dims", "3,4,5"}, {"type", "uint8"}};
    std::erase_if(query, [&, name = name](const auto& pair) { return pair.first == name; });
    query.emplace_back(name, value);
    const Error error =
        error_of([&] { raw_description_of(with_query(query)); }, name + '=' + value);
    EXPECT_THAT(fields_of(error), ElementsAre(name)) << value;
  }
}

TEST(RawDescription, PartsOfItWithoutDimsAreRefused) {
  for (const std::string name : {"type", "origin", "direction", "byte_order"}) {
    const Error error = error_of([&] { raw_description_of(with_query({{name, "1"}})); }, name);
    EXPECT_THAT(fields_of(error), ElementsAre("dims"));
  }
}

TEST(ImportParameters, AreAllThatAreRead) {
  EXPECT_THAT(
      import_parameters(),
      UnorderedElementsAre("dims", "type", "spacing", "origin", "direction", "byte_order", "series",
                           "member", "masks", "volume", "accept", "nifti_form", "modality"));
}

TEST(ImportOptionsOf, TakesASeries) {
  const auto options = import_options_of(with_query({{"series", "1.2.840.113619.2.30"}}));
  EXPECT_EQ(options.series, "1.2.840.113619.2.30");
  EXPECT_FALSE(options.raw);
  EXPECT_TRUE(import_options_of(with_query({})).series.empty());
}

TEST(ImportOptionsOf, RefusesASeriesThatIsNoUid) {
  for (const std::string& series : {std::string(), std::string("1.2.x"), std::string("../1"),
                                    std::string("1.2 "), std::string(65, '1')}) {
    const Error error = error_of(
        [&] {
          import_options_of(with_query({{"series", series}}));
        },
        series);
    EXPECT_THAT(fields_of(error), ElementsAre("series"));
  }
}

TEST(ImportOptionsOf, RawSamplesHaveNothingToChoose) {
  for (const auto& [name, value] : Pairs{{"series", "1.2"},
                                         {"member", "a.nrrd"},
                                         {"masks", "true"},
                                         {"volume", "1"},
                                         {"accept", "frame-of-reference"},
                                         {"nifti_form", "sform"}}) {
    const Pairs query = {{"dims", "3,4,5"}, {"type", "int16"}, {name, value}};
    const Error error = error_of([&] { import_options_of(with_query(query)); }, name);
    EXPECT_THAT(fields_of(error), ElementsAre(name));
  }
}

TEST(ImportOptionsOf, TakesWhatChoosesAndAccepts) {
  const auto options = import_options_of(with_query({{"member", "sub/ct.nrrd"},
                                                     {"volume", "0"},
                                                     {"accept", "frame-of-reference"},
                                                     {"nifti_form", "qform"}}));
  EXPECT_EQ(options.member, "sub/ct.nrrd");
  EXPECT_EQ(options.volume, 0U);
  EXPECT_TRUE(options.accepts(NoteCode::kFrameOfReference));
  EXPECT_EQ(options.nifti_form, NiftiForm::kQform);
  EXPECT_FALSE(options.masks);
  EXPECT_TRUE(import_options_of(with_query({{"masks", "true"}})).masks);
  const auto none = import_options_of(with_query({}));
  EXPECT_FALSE(none.volume || none.nifti_form || none.accepts(NoteCode::kFrameOfReference));
}

TEST(ImportOptionsOf, TakesTheSpacingOfAFileThatHasNone) {
  const auto options = import_options_of(with_query({{"spacing", "0.5,1,2"}}));
  EXPECT_FALSE(options.raw);
  EXPECT_EQ(options.spacing, (std::array<double, 3>{0.5, 1, 2}));
  EXPECT_FALSE(import_options_of(with_query({})).spacing);
}

TEST(ImportOptionsOf, TakesTheModalityOfAnyFile) {
  EXPECT_EQ(import_options_of(with_query({{"modality", "ct"}})).modality, SaidModality::kCt);
  const Pairs raw = {{"dims", "3,4,5"}, {"type", "int16"}, {"modality", "ct"}};
  EXPECT_EQ(import_options_of(with_query(raw)).modality, SaidModality::kCt);
  EXPECT_FALSE(import_options_of(with_query({})).modality);
}

TEST(ImportOptionsOf, RefusesOtherValues) {
  for (const auto& pair : Pairs{{"member", ""},
                                {"member", "a\nb"},
                                {"volume", "-1"},
                                {"volume", "4294967296"},
                                {"volume", "one"},
                                {"accept", ""},
                                {"accept", "missing-slices"},
                                {"accept", "forms-differ"},
                                {"accept", "frame-of-reference,"},
                                {"spacing", "1,1"},
                                {"spacing", "1,1,0"},
                                {"spacing", "1,1,nan"},
                                {"modality", "mr"},
                                {"nifti_form", "both"},
                                {"masks", "1"}}) {
    const Error error =
        error_of([&] { import_options_of(with_query({pair})); }, pair.first + '=' + pair.second);
    EXPECT_THAT(fields_of(error), ElementsAre(pair.first)) << pair.second;
  }
}

TEST(UploadNameOf, IsWhatTheHeaderTells) {
  const auto file_name_of = [](std::string_view header) {
    const import::UploadName name = upload_name_of(header);
    EXPECT_FALSE(name.is_chosen) << header;
    return name.text;
  };
  EXPECT_EQ(file_name_of("attachment; filename=\"a b.nii.gz\""), "a b.nii.gz");
  EXPECT_EQ(file_name_of("attachment; filename=ct.nrrd; x=y"), "ct.nrrd");
  EXPECT_EQ(file_name_of("attachment; x=\"; filename=no\"; filename = b.nrrd"), "b.nrrd");
  EXPECT_EQ(file_name_of("attachment; filename=\"x\"; FileName*=UTF-8''M%C3%BCller%20ct"),
            "M\xC3\xBCller ct");
  EXPECT_EQ(file_name_of("attachment; filename=\"..\\\\secret\\\\a.nii\""), "a.nii");
  EXPECT_EQ(file_name_of("attachment; filename*=UTF-8''%2Fetc%2F%0A%zz%4"), "%zz%4");
  EXPECT_EQ(file_name_of("attachment"), "");
  EXPECT_EQ(file_name_of(""), "");
  EXPECT_EQ(file_name_of("attachment; name=\" \"; filename=a"), "a");
}

TEST(UploadNameOf, IsTheOneThatAPersonChose) {
  const auto chosen = [](const std::string& text) { return import::UploadName{text, true}; };
  EXPECT_EQ(upload_name_of("attachment; filename=a.nii; name=\"left/right\""),
            chosen("left/right"));
  EXPECT_EQ(upload_name_of("attachment; name*=UTF-8''M%C3%BCller%0A"), chosen("M\xC3\xBCller"));
}

TEST(PlainFileName, IsCutBetweenCharacters) {
  std::string name(254, 'a');
  EXPECT_EQ(plain_file_name(name + "\xC3\xBC"), name);
  EXPECT_EQ(plain_file_name(name + "b"), name + "b");
}

}  // namespace
}  // namespace isomesh::http
