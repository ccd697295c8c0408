// Requests of clients in the query of an URL: read by the server.
#include <string>
#include <utility>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "proto/json.h"
#include "tests/support/errors.h"

namespace isomesh {
namespace {

using test::error_of;
using test::fields_of;
using test::thrown_by;
using testing::ElementsAre;
using Query = std::vector<std::pair<std::string, std::string>>;

std::vector<std::string> query_faults(const Query& query) {
  const auto error = thrown_by([&] { parse_job_parameters(query); });
  return error ? fields_of(*error) : std::vector<std::string>{"nothing was refused"};
}

TEST(JobQuery, NeedsAnIsoOnly) {
  JobParameters expected;
  expected.iso = 60;
  expected.lambda = 1;
  EXPECT_EQ(parse_job_parameters(Query{{"iso", "60"}}), expected);
  EXPECT_THAT(query_faults(Query{}), ElementsAre("iso"));
}

// Faults are named as the client spelled them.
TEST(JobQuery, RefusesByTheQuerysNames) {
  const auto fault = [](const std::string& name, const std::string& value) {
    return query_faults(Query{{"iso", "1"}, {name, value}});
  };
  for (const auto& [name, value] : Query{{"scheme", "7"},        {"scheme", ""},
                                         {"passes", "five"},     {"passes", "-1"},
                                         {"lambda", "0"},        {"close", "yes"},
                                         {"priority", "urgent"}, {"format", ""},
                                         {"format", "exe"},      {"format", "drc,,stl"},
                                         {"position_bits", "7"}, {"speed", "11"},
                                         {"speed", ""},          {"keep", "0"},
                                         {"keep", "all"},        {"min_triangles", "1.5"},
                                         {"normals", "2"},       {"components", "{}"},
                                         {"volume", "abc"},      {"formats", "drc"},
                                         {"draco", "{}"},        {"isovalue", "3"}}) {
    EXPECT_THAT(fault(name, value), ElementsAre(name)) << name << '=' << value;
  }
}

TEST(JobQuery, RefusesAnIsoThatIsNoNumber) {
  for (const std::string& iso :
       {std::string(), std::string("abc"), std::string("nan"), std::string("inf"),
        std::string("1e999"), std::string("true"), std::string("[1]"), std::string("0x10"),
        std::string("1,5"), std::string("5\0", 2), std::string("5\0x", 3)}) {
    EXPECT_THAT(query_faults(Query{{"iso", iso}}), ElementsAre("iso")) << iso;
  }
}

TEST(JobQuery, TakesNumbersThatJsonWouldNot) {
  for (const auto& [text, number] : {std::pair{".5", 0.5}, {"5.", 5.0}, {"-.25", -0.25}}) {
    EXPECT_EQ(parse_job_parameters(Query{{"iso", text}}, VolumeIn::kBody).iso, number) << text;
  }
}

TEST(JobQuery, CallsParametersSo) {
  const Error error = error_of([] {
    parse_job_parameters(Query{{"iso", "1"}, {"isovalue", "1"}}, VolumeIn::kBody);
  });
  EXPECT_STREQ(error.what(), "isovalue: is not a parameter of this request");
}

TEST(JobQuery, RefusesAParameterGivenTwice) {
  EXPECT_THAT(query_faults(Query{{"iso", "1"}, {"iso", "2"}}), ElementsAre("iso"));
  EXPECT_THAT(query_faults(Query{{"iso", "1"}, {"speed", "2"}, {"speed", "2"}}),
              ElementsAre("speed"));
  EXPECT_THAT(query_faults(Query{{"iso", "1"}, {"format", "drc"}, {"format", "stl"}}),
              ElementsAre("format"));
}

TEST(JobQuery, NamesLabels) {
  EXPECT_TRUE(parse_job_parameters(Query{{"labels", "all"}}).labels->is_all());
  const JobParameters some = parse_job_parameters(Query{{"labels", "5,3"}, {"background", "-1"}});
  EXPECT_EQ(some.labels->values, (std::vector<std::int64_t>{3, 5}));
  EXPECT_EQ(some.background, -1);
  EXPECT_THAT(query_faults(Query{{"labels", "3,x"}}), ElementsAre("labels"));
  EXPECT_THAT(query_faults(Query{{"labels", ""}}), ElementsAre("labels"));
  JobParameters asked = label_parameters({{3, 5}});
  asked.volume = "a";
  asked.lambda = 0.25;
  EXPECT_EQ(parse_job_parameters(to_query(asked), VolumeIn::kQuery), asked);
}

TEST(JobQuery, CarriesNumbersAndPlacesInOneList) {
  const JobParameters parameters = parse_job_parameters(Query{{"volume", "a"},
                                                              {"iso", "60"},
                                                              {"crop", "-1,-2,-3,4,5,6.5"},
                                                              {"nearest_to", "1,2,3,4,5,6"},
                                                              {"lods", "1,0.25"},
                                                              {"format", "glb"}},
                                                        VolumeIn::kQuery);
  EXPECT_EQ(parameters.crop, (Box{{{-1, -2, -3}, {4, 5, 6.5}}}));
  EXPECT_EQ(parameters.components.nearest_to.size(), 2U);
  EXPECT_EQ(parameters.lods, (std::vector<double>{1, 0.25}));
  EXPECT_EQ(parse_job_parameters(to_query(parameters), VolumeIn::kQuery), parameters);
}

}  // namespace
}  // namespace isomesh
