// Requests of clients as JSON: read by the server.
#include <map>
#include <string>
#include <utility>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "proto/json.h"
#include "proto/parameters.h"
#include "tests/support/errors.h"

namespace isomesh {
namespace {

using test::code_thrown_by;
using test::error_of;
using test::fields_of;
using test::thrown_by;
using testing::ElementsAre;
using testing::HasSubstr;
using testing::UnorderedElementsAre;

// A body with what is required and one member more.
std::string body_with(const std::string& member) {
  return R"({"volume": "a", "iso": 60)" + (member.empty() ? "" : ", " + member) + "}";
}

JobParameters parsed(const std::string& member) { return parse_job_parameters(body_with(member)); }

std::vector<std::string> faults_in(const std::string& body) {
  const auto error = thrown_by([&] { parse_job_parameters(body); });
  if (!error) return {"nothing was refused"};
  EXPECT_EQ(error->code(), ErrorCode::kInvalidParameter);
  for (const FieldError& field : error->fields()) {
    EXPECT_THAT(error->what(), HasSubstr(field.field + ": " + field.message));
  }
  return fields_of(*error);
}

std::vector<std::string> faults_of(const std::string& member) {
  return faults_in(body_with(member));
}

TEST(JobBody, MayNameLabelsInPlaceOfAnIso) {
  const auto of_labels = [](const std::string& members) {
    return parse_job_parameters(R"({"volume": "a", "labels": )" + members + "}");
  };
  JobParameters expected = label_parameters({});
  expected.volume = "a";
  expected.lambda = default_lambda(expected);
  EXPECT_EQ(of_labels("\"all\""), expected);
  EXPECT_EQ(expected.passes, 10);
  EXPECT_EQ(expected.smoothing, Smoothing::kLabels);
  EXPECT_TRUE(expected.regularize);
  EXPECT_EQ(of_labels("[7, 3, 7, -1]").labels->values, (std::vector<std::int64_t>{-1, 3, 7}));
  // Labels of 64 bits are strings where a number would lose digits.
  EXPECT_EQ(of_labels(R"(["720575940618780781", 4294967296, -720575940618780782])").labels->values,
            (std::vector<std::int64_t>{-720575940618780782, 4294967296, 720575940618780781}));
  EXPECT_EQ(of_labels(R"("all", "passes": 2, "smoothing": "taubin")").passes, 2);
  EXPECT_EQ(of_labels(R"("all", "smoothing": "taubin")").lambda, row_of(Smoothing::kTaubin).lambda);
  EXPECT_EQ(of_labels(R"("all", "label_colors": {"3": "#AAbb00"})").label_colors.at(3), "#aabb00");
  EXPECT_EQ(of_labels(R"("all", "label_values": {"3": [9, 4, 9]})").label_values,
            (LabelValues{{3, {4, 9}}}));
}

TEST(JobBody, HasTheDefaultsByLabelsThatTheTableTells) {
  JobParameters parameters = parse_job_parameters(R"({"volume": "a", "labels": "all"})");
  std::map<std::string, std::string> told;
  visit(parameters, [&](const Parameter& row, const auto& /*member*/) {
    if (const std::string told_of = default_by_labels(row); !told_of.empty()) {
      told[row.name] = told_of;
    }
  });
  EXPECT_EQ(told, (std::map<std::string, std::string>{
                      {"passes", std::to_string(parameters.passes)},
                      {"smoothing", std::string(to_string(parameters.smoothing))},
                      {"lambda", number_text(*parameters.lambda)}}));
}

TEST(JobBody, RefusesWhatLabelsCannotHave) {
  const std::vector<std::pair<std::string, std::string>> faults = {
      {R"("iso": 3, "smoothing": "labels")", "smoothing"},
      {R"("labels": "all", "iso": 3)", "iso"},
      {R"("labels": "all", "iso": "otsu")", "iso"},
      {R"("labels": null)", "labels"},
      {R"("labels": [])", "labels"},
      {R"("labels": [1, "2"])", "labels"},
      {R"("labels": [0])", "labels"},
      {R"("labels": [5], "background": 5)", "labels"},
      {R"("labels": "all", "interpolation": "linear")", "interpolation"},
      {R"("labels": "all", "inside": "below")", "inside"},
      {R"("labels": "all", "fill_cavities": true)", "fill_cavities"},
      {R"("labels": "all", "components": {"keep": 1})", "components"},
      {R"("labels": "all", "label_names": {"3": ""})", "label_names.3"},
      {R"("labels": "all", "label_names": {"03x": "a"})", "label_names.03x"},
      {R"("labels": "all", "label_names": ["a"])", "label_names"},
      {R"("labels": "all", "label_names": {" 1": "a"})", "label_names. 1"},
      {R"("labels": "all", "label_names": {"1": 3})", "label_names.1"},
      {R"("labels": "all", "label_names": {"9223372036854775808": "a"})",
       "label_names.9223372036854775808"},
      {R"("labels": ["9223372036854775808"])", "labels"},
      {R"("labels": [9223372036854775808])", "labels"},
      {R"("labels": "all", "label_colors": {"1": "red"})", "label_colors.1"},
      {R"("labels": "all", "label_values": {"3": []})", "label_values.3"},
      {R"("labels": "all", "label_values": {"3": [0]})", "label_values"},
      {R"("labels": "all", "label_values": {"0": [3]})", "label_values"}};
  for (const auto& [members, field] : faults) {
    EXPECT_THAT(faults_in(R"({"volume": "a", )" + members + "}"), ElementsAre(field)) << members;
  }
  EXPECT_THAT(
      faults_in(
          R"({"volume": "a", "iso": 3, "background": 1, "label_names": {}, "formats": ["zip"]})"),
      UnorderedElementsAre("background", "label_names", "formats"));
}

TEST(JobBody, NeedsAVolumeAndAnIsoOnly) {
  JobParameters expected;
  expected.volume = "a";
  expected.iso = 60;
  expected.lambda = 1;
  EXPECT_EQ(parsed(""), expected);
  EXPECT_THAT(faults_in("{}"), UnorderedElementsAre("volume", "iso"));
  EXPECT_THAT(faults_in(R"({"volume": "a"})"), ElementsAre("iso"));
  EXPECT_THAT(faults_in(R"({"iso": 3})"), ElementsAre("volume"));
}

TEST(JobBody, TakesEveryMember) {
  const JobParameters unusual = {{.iso = -150,
                                  .inside = Inside::kBelow,
                                  .scheme = SchemeName::kFive,
                                  .interpolation = Interpolation::kMidpoint,
                                  .regularize = true,
                                  .passes = 17,
                                  .smoothing = Smoothing::kTaubin,
                                  .lambda = 0.25,
                                  .pass_band = 0.05,
                                  .max_displacement_mm = 0.5,
                                  .close = true,
                                  .components = {.keep = 2, .min_triangles = 100, .nearest_to = {}},
                                  .formats = {MeshFormat::kStl, MeshFormat::kGlb},
                                  .draco = {.position_bits = 11, .speed = 3},
                                  .normals = true},
                                 {},
                                 "abc",
                                 Priority::kBulk};
  EXPECT_EQ(parse_job_parameters(R"({"volume": "abc", "iso": -1.5e2, "inside": "below", "scheme": 5,
      "interpolation": "midpoint", "regularize": true, "passes": 17, "smoothing": "taubin",
      "lambda": 0.25, "pass_band": 0.05, "max_displacement_mm": 0.5,
      "close": true, "components": {"keep": 2, "min_triangles": 100}, "formats": ["stl", "glb"],
      "draco": {"position_bits": 11, "speed": 3}, "normals": true, "priority": "bulk"})"),
            unusual);
}

TEST(JobBody, TellsANameOfASchemeAsItWasGiven) {
  for (const std::string name : {"5", "6", R"("fcc")", R"("kuhn")", R"("bcc")"}) {
    const JobParameters parameters = parsed(R"("scheme": )" + name);
    EXPECT_THAT(to_json(parameters), testing::HasSubstr(R"("scheme":)" + name + ','));
  }
  EXPECT_EQ(scheme_of(parsed(R"("scheme": "fcc")").scheme), Scheme::kFive);
  EXPECT_EQ(scheme_of(parsed(R"("scheme": "kuhn")").scheme), Scheme::kSix);
}

TEST(JobBody, IsWhatToJsonWrites) {
  JobParameters parameters;
  parameters.volume = "a";
  parameters.lambda = 0.5;
  EXPECT_EQ(parse_job_parameters(to_json(parameters)), parameters);
  parameters.iso = 0.1;
  parameters.components.keep = 7;
  parameters.formats = {MeshFormat::kObj, MeshFormat::kPly};
  EXPECT_EQ(parse_job_parameters(to_json(parameters)), parameters);
}

TEST(JobBody, WithoutALambdaTheSmoothingHasItsOwn) {
  EXPECT_EQ(parsed("").lambda, 1);
  EXPECT_EQ(parsed(R"("smoothing": "taubin")").lambda, row_of(Smoothing::kTaubin).lambda);
  EXPECT_EQ(parsed(R"("smoothing": "taubin", "lambda": null)").lambda, 0.33);
  EXPECT_EQ(parsed(R"("lambda": null)").lambda, 1);
}

TEST(JobBody, OtsuIsNoNumberAndNullNoLimit) {
  EXPECT_EQ(parse_job_parameters(R"({"volume": "a", "iso": "otsu"})").iso, std::nullopt);
  EXPECT_EQ(parsed(R"("max_displacement_mm": null)").max_displacement_mm, std::nullopt);
}

TEST(JobBody, DracoMayBePartial) {
  EXPECT_EQ(parsed(R"("draco": {})").draco, DracoParameters{});
  EXPECT_EQ(parsed(R"("draco": {"speed": 0})").draco, (DracoParameters{14, 0}));
}

TEST(JobBody, ComponentsMayBePartialAndNull) {
  EXPECT_EQ(parsed(R"("components": {})").components, ComponentFilter{});
  EXPECT_EQ(parsed(R"("components": {"keep": 1})").components, (ComponentFilter{1, {}, {}}));
  EXPECT_EQ(parsed(R"("components": {"keep": null, "min_triangles": 4294967295})").components,
            (ComponentFilter{{}, 4294967295, {}}));
}

TEST(JobBody, LevelsOfDetailGoDown) {
  const auto lods = [](const std::string& list) {
    return R"("formats": ["glb"], "lods": )" + list;
  };
  EXPECT_EQ(parsed(lods("[1, 0.25, 0.05]")).lods, (std::vector<double>{1, 0.25, 0.05}));
  for (const char* const wrong : {"[]", "[0.5]", "[1, 1]", "[1, 0.2, 0.3]", "[1, 0]", "[2, 1]", "1",
                                  R"(["1"])", "[1,0.9,0.8,0.7,0.6,0.5,0.4,0.3,0.2]"}) {
    EXPECT_THAT(faults_of(lods(wrong)), ElementsAre("lods")) << wrong;
  }
  EXPECT_THAT(faults_of(R"("formats": ["stl"], "lods": [1])"), ElementsAre("lods"));
}

TEST(JobBody, DistancesAreForGlb) {
  EXPECT_TRUE(parsed(R"("formats": ["stl", "glb"], "distances": true)").distances);
  EXPECT_FALSE(parsed("").distances);
  EXPECT_THAT(faults_of(R"("formats": ["stl"], "distances": true)"), ElementsAre("distances"));
  EXPECT_THAT(faults_of(R"("formats": ["glb"], "distances": 1)"), ElementsAre("distances"));
}

TEST(JobBody, ABoxIsItsTwoCornersAndClosesTheSurface) {
  const JobParameters parameters = parsed(R"("crop": [[-1, -2, -3], [4, 5, 6.5]])");
  EXPECT_EQ(parameters.crop, (Box{{{-1, -2, -3}, {4, 5, 6.5}}}));
  EXPECT_TRUE(parameters.close);
  EXPECT_TRUE(parsed(R"("crop": [[0, 0, 0], [1, 1, 1]], "close": false)").close);
  for (const char* const wrong :
       {"[]", "[[0, 0, 0]]", "[[0, 0, 0], [1, 1]]", "[[0, 0, 0], [1, 1, 0]]", "[0, 0, 0, 1, 1, 1]",
        R"([["0", 0, 0], [1, 1, 1]])", "true"}) {
    EXPECT_THAT(faults_of(std::string(R"("crop": )") + wrong), ElementsAre("crop")) << wrong;
  }
}

TEST(JobBody, ABoundForTheErrorIsMeasured) {
  EXPECT_TRUE(parsed(R"("max_error_mm": 0.1)").certify);
  EXPECT_TRUE(parsed(R"("triangles": 1000)").certify);
  EXPECT_FALSE(parsed(R"("triangles": 1000, "certify": false)").certify);
  EXPECT_FALSE(parsed("").certify);
  EXPECT_THAT(faults_of(R"("max_error_mm": 0.1, "certify": false)"), ElementsAre("certify"));
  EXPECT_THAT(faults_of(R"("max_error_mm": 0)"), ElementsAre("max_error_mm"));
  EXPECT_THAT(faults_of(R"("triangles": 3)"), ElementsAre("triangles"));
}

TEST(JobBody, UntanglingNeedsSmoothing) {
  EXPECT_TRUE(parsed(R"("untangle": true)").untangle);
  EXPECT_FALSE(parsed("").untangle);
  EXPECT_THAT(faults_of(R"("untangle": true, "passes": 0)"), ElementsAre("untangle"));
  EXPECT_FALSE(parsed(R"("untangle": false, "passes": 0)").untangle);
  EXPECT_THAT(faults_of(R"("untangle": 1)"), ElementsAre("untangle"));
}

TEST(JobBody, PlacesOfPartsAreOfThreeNumbers) {
  const auto at = [](const std::string& list) {
    return R"("components": {"nearest_to": )" + list + "}";
  };
  EXPECT_EQ(parsed(at("[[1, 2, 3], [-4, 5, 6]]")).components.nearest_to.size(), 2U);
  for (const char* const wrong : {"[]", "[1, 2, 3]", "[[1, 2]]", "null"}) {
    EXPECT_THAT(faults_of(at(wrong)), ElementsAre("components.nearest_to")) << wrong;
  }
}

TEST(JobBody, AFormatNamedTwiceIsMadeOnce) {
  EXPECT_THAT(parsed(R"("formats": ["stl", "drc", "stl"])").formats,
              ElementsAre(MeshFormat::kStl, MeshFormat::kDrc));
}

// A member that is out of range or of the wrong type, and the name under which it is refused.
struct Refused {
  std::string member;
  std::string field;
};

class OneFault : public testing::TestWithParam<Refused> {};

TEST_P(OneFault, IsRefusedByName) {
  EXPECT_THAT(faults_in(body_with(GetParam().member)), ElementsAre(GetParam().field))
      << GetParam().member;
}

// Bounds: see Parameters.BoundsAreThoseOfTheTable.
INSTANTIATE_TEST_SUITE_P(
    Ranges, OneFault,
    testing::Values(Refused{R"("passes": 1e300)", "passes"}, Refused{R"("passes": 4.5)", "passes"},
                    Refused{R"("passes": 18446744073709551621)", "passes"},
                    Refused{R"("scheme": 4)", "scheme"}, Refused{R"("scheme": 5.5)", "scheme"},
                    Refused{R"("components": {"keep": 1.5})", "components.keep"},
                    Refused{R"("components": {"min_triangles": 1e300})",
                            "components.min_triangles"}));

INSTANTIATE_TEST_SUITE_P(
    Types, OneFault,
    testing::Values(
        Refused{R"("scheme": "6")", "scheme"}, Refused{R"("scheme": true)", "scheme"},
        Refused{R"("scheme": null)", "scheme"}, Refused{R"("scheme": [6])", "scheme"},
        Refused{R"("inside": true)", "inside"}, Refused{R"("inside": "Below")", "inside"},
        Refused{R"("interpolation": 1)", "interpolation"},
        Refused{R"("interpolation": "cubic")", "interpolation"},
        Refused{R"("interpolation": "Linear")", "interpolation"},
        Refused{R"("interpolation": "")", "interpolation"}, Refused{R"("passes": "5")", "passes"},
        Refused{R"("passes": false)", "passes"}, Refused{R"("passes": null)", "passes"},
        Refused{R"("smoothing": "gauss")", "smoothing"}, Refused{R"("lambda": "1")", "lambda"},
        Refused{R"("lambda": {})", "lambda"}, Refused{R"("pass_band": null)", "pass_band"},
        Refused{R"("max_displacement_mm": "otsu")", "max_displacement_mm"},
        Refused{R"("close": 1)", "close"}, Refused{R"("normals": 1)", "normals"},
        Refused{R"("components": 3)", "components"}, Refused{R"("components": null)", "components"},
        Refused{R"("components": {"keep": "1"})", "components.keep"},
        Refused{R"("components": {"keep": true})", "components.keep"},
        Refused{R"("close": "true")", "close"}, Refused{R"("formats": [])", "formats"},
        Refused{R"("formats": "drc")", "formats"}, Refused{R"("formats": {"drc": 1})", "formats"},
        Refused{R"("formats": ["drc", "exe"])", "formats"},
        Refused{R"("formats": ["drc", 1, 2])", "formats"}, Refused{R"("draco": 14)", "draco"},
        Refused{R"("draco": null)", "draco"}, Refused{R"("draco": [14, 7])", "draco"},
        Refused{R"("priority": "urgent")", "priority"}, Refused{R"("priority": 0)", "priority"}));

INSTANTIATE_TEST_SUITE_P(UnknownMembers, OneFault,
                         testing::Values(Refused{R"("isovalue": 3)", "isovalue"},
                                         Refused{R"("Iso": 3)", "Iso"}, Refused{R"("": 3)", ""},
                                         Refused{R"("position_bits": 14)", "position_bits"},
                                         Refused{R"("draco": {"bits": 3})", "draco.bits"}));

TEST(JobBody, AnIsoThatIsNoNumberAndAVolumeThatIsNoStringAreRefused) {
  for (const std::string iso :
       {"\"60\"", "\"Otsu\"", "\"\"", "null", "true", "[60]", "{}", "\"NaN\"", "\"inf\""}) {
    EXPECT_THAT(faults_in(R"({"volume": "a", "iso": )" + iso + "}"), ElementsAre("iso")) << iso;
  }
  for (const std::string volume : {"7", "null", "[\"a\"]", "{}"}) {
    EXPECT_THAT(faults_in(R"({"iso": 1, "volume": )" + volume + "}"), ElementsAre("volume"));
  }
}

TEST(JobBody, AllFaultsAreNamedAtOnce) {
  EXPECT_THAT(faults_in(R"({"iso": "x", "scheme": 9, "passes": -1, "close": 0, "lambda": 2,
                            "draco": {"speed": 99, "bits": 1}, "unknown": 1})"),
              UnorderedElementsAre("volume", "iso", "scheme", "passes", "close", "lambda",
                                   "draco.speed", "draco.bits", "unknown"));
}

TEST(JobBody, MessagesSayWhatIsAllowed) {
  const auto detail = [](const std::string& member) {
    return std::string(thrown_by([&] { parsed(member); })->what());
  };
  EXPECT_EQ(detail(R"("passes": 1001)"), "passes: must be a whole number from 0 to 1000");
  EXPECT_EQ(detail(R"("draco": {"position_bits": 31})"),
            "draco.position_bits: must be a whole number from 8 to 30");
  EXPECT_EQ(detail(R"("draco": {"speed": 31})"),
            "draco.speed: must be a whole number from 0 to 10");
  EXPECT_EQ(detail(R"("scheme": 7)"), R"(scheme: must be 5, 6, "fcc", "kuhn" or "bcc")");
  EXPECT_EQ(
      std::string(thrown_by([] {
                    parse_job_parameters(R"({"volume": "a", "labels": "all", "scheme": "bcc"})");
                  })->what()),
      R"(scheme: cannot be "bcc" with labels: there are no values between two labels)");
  EXPECT_EQ(detail(R"("priority": "x")"), R"(priority: must be "stat", "routine" or "bulk")");
  EXPECT_EQ(detail(R"("isovalue": 3)"), "isovalue: is not a known member");
}

class HostileBody : public testing::TestWithParam<std::string> {};

TEST_P(HostileBody, IsRefused) {
  EXPECT_EQ(code_thrown_by([&] { parse_job_parameters(GetParam()); }),
            ErrorCode::kInvalidParameter);
}

INSTANTIATE_TEST_SUITE_P(
    Bodies, HostileBody,
    testing::Values("", " ", "null", "7", "\"volume\"", "[]", R"([{"volume": "a", "iso": 1}])",
                    R"({"volume": "a", "iso": NaN})", R"({"volume": "a", "iso": Infinity})",
                    R"({"volume": "a", "iso": 1e999})", R"({"volume": "a", "iso": -1e999})",
                    R"({"volume": "a", "iso": 1)", R"({"volume": "a", "iso": 1}})",
                    R"({"volume": "a", "iso": 1} {})", R"({"volume": "a", "iso": 1,})",
                    R"({"volume": "a", /* comment */ "iso": 1})", "{\"volume\": \"\xff\"}",
                    "{\"volume\": \"a\xc3\", \"iso\": 1}", "{\"volume\": \"a\nb\", \"iso\": 1}",
                    std::string(65536, '['), std::string(65536, '{'),
                    R"({"volume": "a", "iso": )" + std::string(30'000, '[') +
                        std::string(30'000, ']') + "}",
                    R"({"volume": "a", "iso": 1, "draco": )" + std::string(30'000, '[') +
                        std::string(30'000, ']') + "}",
                    "{\"volume\": \"a\", \"iso\": " + std::string(60'000, '9') + "}"));

TEST(JobBody, LongNamesAndValuesDoNotComeBackWhole) {
  const std::string longest(64 * 1024, 'x');
  for (const std::string& body :
       {body_with('"' + longest + "\": 1"), body_with("\"interpolation\": \"" + longest + '"')}) {
    const Error error = error_of([&] { parse_job_parameters(body); });
    EXPECT_LT(std::string(error.what()).size(), 1000U);
  }
}

TEST(JobBody, ManyUnknownMembersDoNotComeBackAll) {
  std::string body = R"({"volume": "a", "iso": 1)";
  for (int n = 0; n < 5000; ++n) body += ", \"m" + std::to_string(n) + "\": 1";
  const Error error = error_of([&] { parse_job_parameters(body + "}"); });
  EXPECT_GE(error.fields().size(), 10U);
  EXPECT_LE(error.fields().size(), 100U);
}

TEST(JobBody, ALongVolumeIsAnIdThatNothingHas) {
  const std::string longest(60 * 1024, 'x');
  EXPECT_EQ(parse_job_parameters(R"({"iso": 1, "volume": ")" + longest + "\"}").volume, longest);
}

// Readers differ in which one they take (RFC 8259, 4).
TEST(JobBody, AMemberGivenTwiceIsRefused) {
  EXPECT_THAT(faults_in(R"({"volume": "a", "iso": 1, "iso": 1})"), ElementsAre("iso"));
  EXPECT_THAT(faults_in(R"({"volume": "a", "iso": 1, "draco": {"speed": 1, "speed": 2}})"),
              ElementsAre("draco.speed"));
  EXPECT_THAT(faults_in(R"({"volume": "a", "labels": "all", "label_names": {"1": "a", "1": "b"}})"),
              ElementsAre("label_names.1"));
  EXPECT_THAT(faults_in(R"({"volume": "a", "iso": 1, "x": {"iso": 1}})"), ElementsAre("x"));
}

TEST(JobBody, ControlCharactersOfNamesAreShown) {
  const Error error =
      error_of([] { parse_job_parameters(R"({"volume": "a", "iso": 1, "a\u0000b": 1})"); });
  EXPECT_STREQ(error.what(), "a\uFFFDb: is not a known member");
}

TEST(JobBody, MembersOfNonUtf8NamesAreRefusedWithoutThem) {
  const Error error = error_of([] { parsed("\"\\ud800\": 1"); });
  EXPECT_EQ(error.code(), ErrorCode::kInvalidParameter);
}

// The parser says no more of it than that the body is not JSON.
TEST(JobBody, RefusesHalfOfASurrogatePairByItsMember) {
  const auto names = [](const std::string& name) {
    return R"({"volume": "a", "labels": "all", "label_names": {"7": ")" + name + "\"}}";
  };
  for (const std::string half :
       {R"(\ud800)", R"(\uDFFF)", R"(a\ud83d)", R"(\ud83d\ud83d\ude00)", R"(\\\udc00)"}) {
    EXPECT_THAT(faults_in(names(half)), ElementsAre("label_names.7")) << half;
  }
  for (const std::string whole :
       {R"(\ud83d\ude00)", R"(\uD83D\uDE00!)", R"(\\ud800)", R"(\u0041)"}) {
    EXPECT_NO_THROW(parse_job_parameters(names(whole))) << whole;
  }
  const auto error = thrown_by([&] { parse_job_parameters(names(R"(\ud800)")); });
  EXPECT_THAT(error->what(), HasSubstr("half of a surrogate pair"));
  EXPECT_THAT(faults_in(R"({"volume": "\ud800", "iso": 1})"), ElementsAre("volume"));
  EXPECT_THAT(faults_in(R"({"volume": "a", "iso": 1, "formats": ["\udc00"]})"),
              ElementsAre("formats"));
  EXPECT_THAT(faults_in(R"({"volume": "a", "iso": 1, "\udc00": 1})").size(), 1U);
  const auto renamed = thrown_by([] { parse_volume_name(R"({"name": "\ud800"})"); });
  ASSERT_TRUE(renamed);
  EXPECT_THAT(fields_of(*renamed), ElementsAre("name"));
}

// Text that the parser cannot read stays unreadable.
// The JSON library takes one for the end of the text.
TEST(JobBody, RefusesNulBytesAnywhere) {
  const std::string body = body_with(R"("draco": {"speed": 3})");
  EXPECT_EQ(code_thrown_by([&] { parse_job_parameters(body); }), std::nullopt);
  for (std::size_t at = 0; at <= body.size(); ++at) {
    for (const std::string& more : {std::string(1, '\0'), std::string("\0{\"evil\": 1}", 12)}) {
      const std::string with_nul = body.substr(0, at) + more + body.substr(at);
      EXPECT_EQ(code_thrown_by([&] { parse_job_parameters(with_nul); }),
                ErrorCode::kInvalidParameter)
          << at;
    }
  }
}

TEST(JobBody, RefusesBrokenEscapes) {
  for (const std::string broken : {R"(\u)", R"(\ud8)", R"(\ud80)", R"(\ud80g)", R"(\)"}) {
    const auto error = thrown_by([&] { parse_job_parameters(R"({"volume": ")" + broken + "\"}"); });
    ASSERT_TRUE(error) << broken;
    EXPECT_THAT(error->what(), HasSubstr("one JSON object")) << broken;
  }
}

TEST(JobBody, NamesANumberThatIsTooLarge) {
  EXPECT_THAT(faults_in(R"({"volume": "a", "iso": 1e400})"), ElementsAre("iso"));
  EXPECT_THAT(faults_in(R"({"volume": "a", "labels": "all", "label_values": {"1": [-1e999]}})"),
              ElementsAre("label_values.1"));
  const Error error = error_of([] { parse_job_parameters("[1e400]"); });
  EXPECT_THAT(error.what(), HasSubstr("one JSON object"));
}

TEST(JobBody, TakesAWholeNumberWithAPoint) {
  const JobParameters parameters =
      parse_job_parameters(R"({"volume": "a", "iso": 1, "scheme": 5.0, "passes": 3.0})");
  EXPECT_EQ(parameters.scheme, SchemeName::kFive);
  EXPECT_EQ(parameters.passes, 3);
  EXPECT_THAT(faults_in(R"({"volume": "a", "iso": 1, "scheme": 5.5})"), ElementsAre("scheme"));
  EXPECT_THAT(faults_in(R"({"volume": "a", "iso": 1, "scheme": "5.0"})"), ElementsAre("scheme"));
}

TEST(JobBody, RefusesALabelThatIsSpelledTwice) {
  EXPECT_THAT(
      faults_in(R"({"volume": "a", "labels": "all", "label_names": {"1": "b", "01": "c"}})"),
      ElementsAre("label_names.01"));
  EXPECT_THAT(faults_in(R"({"volume": "a", "labels": "all", "label_values": {"-0": [1], "0": [2]},
                            "background": 9})"),
              ElementsAre("label_values.0"));
}

TEST(VolumeNameBody, RefusesAMemberThatIsGivenTwice) {
  const Error error = error_of([] { parse_volume_name(R"({"name": "a", "name": "b"})"); });
  EXPECT_THAT(fields_of(error), ElementsAre("name"));
}

}  // namespace
}  // namespace isomesh
