// The table of parameters, and what follows from it.
#include "proto/parameters.h"

#include <fstream>
#include <iterator>
#include <set>
#include <string>
#include <type_traits>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include "proto/json.h"
#include "proto/openapi/describe.h"
#include "tests/support/errors.h"

namespace isomesh {
namespace {

using nlohmann::json;
using testing::HasSubstr;

// Calls each(path, parameter, member) for every parameter of a job that has all of them.
template <class Each>
void for_every_parameter(const Each& each) {
  JobParameters parameters;
  parameters.callback.emplace();
  visit_leaves(parameters, each);
}

json body_with(std::string path, const json& value) {
  const bool is_of_labels = path == "background" || path.starts_with("label");
  json body = {{"volume", "a"}};
  if (is_of_labels) {
    body["labels"] = "all";
  } else {
    body["iso"] = 60;
  }
  std::ranges::replace(path, '.', '/');
  body[json::json_pointer('/' + path)] = value;
  return body;
}

// The fault of that value; empty if there is none.
std::string fault_of(const std::string& path, const json& value) {
  const auto error = test::thrown_by([&] { parse_job_parameters(body_with(path, value).dump()); });
  return error ? error->what() : "";
}

// A description that has drifted is brought up to date by
//   cmake --build --preset release --target openapi
TEST(Parameters, AreDescribedAsTheyAre) {
  std::ifstream file(ISOMESH_OPENAPI, std::ios::binary);
  const std::string description{std::istreambuf_iterator<char>(file), {}};
  ASSERT_FALSE(description.empty());
  EXPECT_TRUE(with_parameters(description) == description)
      << "openapi.yaml is not what the table says: build the target openapi";
  EXPECT_NE(description.find(", \"off\","), std::string::npos) << "YAML 1.1 reads off as false";
}

TEST(Parameters, ADescriptionWithoutItsPlacesIsRefused) {
  EXPECT_THROW(with_parameters("openapi: 3.1.0\n"), std::runtime_error);
}

TEST(Parameters, HaveWordsAndNamesOfTheirOwn) {
  std::set<std::string> queries;
  std::set<std::string> options;
  for_every_parameter([&](const std::string& path, const Parameter& parameter, const auto&) {
    EXPECT_TRUE(std::string(parameter.help).ends_with('.')) << path;
    EXPECT_EQ(std::string(parameter.help).find('\n'), std::string::npos) << path;
    EXPECT_TRUE(path == "callback" || *parameter.title != '\0') << path;
    EXPECT_TRUE(queries.insert(query_name_of(parameter)).second) << path;
    EXPECT_TRUE(options.insert(option_name_of(parameter)).second) << path;
  });
  EXPECT_GE(queries.size(), 18U);
}

TEST(Parameters, TheValuesOfAChoiceAreAllExplained) {
  const auto explained = [](const Parameter& parameter) {
    return std::ranges::count_if(parameter.values, [](auto text) { return text != nullptr; });
  };
  for_every_parameter([&](const std::string& path, const Parameter& parameter, const auto& member) {
    using Member = std::remove_cvref_t<decltype(member)>;
    if constexpr (Enumeration<Member>) {
      EXPECT_EQ(explained(parameter), std::ssize(values_of<Member>())) << path;
    } else {
      EXPECT_EQ(explained(parameter), 0) << path;
    }
  });
}

// One step inside and one outside of each bound.
TEST(Parameters, BoundsAreThoseOfTheTable) {
  int bounds = 0;
  for_every_parameter([&](const std::string& path, const Parameter& parameter, const auto& member) {
    using Member = std::remove_cvref_t<decltype(member)>;
    constexpr bool kIsReal =
        std::is_same_v<Member, double> || std::is_same_v<Member, std::optional<double>>;
    const double step = kIsReal ? 1e-6 : 1;
    // Each level of detail depends on the one before it: see JobBody.LevelsOfDetailGoDown.
    if (std::is_same_v<Member, std::vector<double>>) return;
    const auto takes = [&](double value) {
      json number = kIsReal ? json(value) : json(std::llround(value));
      if (std::is_same_v<Member, std::optional<LabelChoice>>) number = json::array({number});
      if (std::is_same_v<Member, LabelValues>) number = {{"1", json::array({number})}};
      const std::string fault = fault_of(path, number);
      if (!fault.empty()) {
        const std::string place = std::is_same_v<Member, LabelValues> ? path + ".1" : path;
        EXPECT_THAT(fault, HasSubstr(place + ": must be"));
        EXPECT_THAT(fault, HasSubstr(range_of(parameter)));
      }
      ++bounds;
      return fault.empty();
    };
    if (parameter.minimum) {
      EXPECT_TRUE(takes(*parameter.minimum)) << path;
      EXPECT_FALSE(takes(*parameter.minimum - step)) << path;
    }
    if (parameter.above) {
      EXPECT_FALSE(takes(*parameter.above)) << path;
      EXPECT_TRUE(takes(*parameter.above + step)) << path;
    }
    if (parameter.maximum) {
      EXPECT_TRUE(takes(*parameter.maximum)) << path;
      EXPECT_FALSE(takes(*parameter.maximum + step)) << path;
    }
  });
  EXPECT_GE(bounds, 26);
}

TEST(Parameters, CasesAreThoseOfTheTable) {
  for_every_parameter([&](const std::string& path, const Parameter& parameter, const auto&) {
    for (const SmoothingCase& entry : parameter.cases) {
      json body = body_with("smoothing", std::string(to_string(entry.smoothing)));
      if (entry.standard) {
        const json all = json::parse(to_json(parse_job_parameters(body.dump())));
        EXPECT_EQ(all[path], *entry.standard) << path;
      }
      if (entry.maximum) {
        body[path] = *entry.maximum;
        EXPECT_NO_THROW(parse_job_parameters(body.dump())) << path;
        body[path] = *entry.maximum + 1e-6;
        const Error error = test::error_of([&] { parse_job_parameters(body.dump()); }, path);
        EXPECT_THAT(error.what(), HasSubstr("must be at most " + number_text(*entry.maximum)));
      }
    }
  });
}

TEST(Parameters, AQueryHasAllButTheCallback) {
  JobParameters parameters;
  parameters.volume = "abc";
  parameters.iso = 0.1;
  parameters.smoothing = Smoothing::kTaubin;
  parameters.lambda = 0.5;
  parameters.pass_band = 0.05;
  parameters.max_displacement_mm = 0.25;
  parameters.close = true;
  parameters.components = {.keep = 3, .min_triangles = 7, .nearest_to = {}};
  parameters.formats = {MeshFormat::kStl, MeshFormat::kGlb};
  parameters.draco = {.position_bits = 11, .speed = 3};
  parameters.normals = true;
  parameters.priority = Priority::kBulk;
  EXPECT_EQ(parse_job_parameters(to_query(parameters), VolumeIn::kQuery), parameters);
  JobParameters with_callback = parameters;
  with_callback.callback = Callback{"https://receiver.example/?key=1"};
  EXPECT_EQ(to_query(with_callback), to_query(parameters));
  parameters.iso.reset();
  EXPECT_EQ(parse_job_parameters(to_query(parameters), VolumeIn::kQuery), parameters);
}

// A mesh's parameters omit what concerns only the job: volume, priority and callback.
TEST(Parameters, AMeshsAreWithoutTheJobs) {
  JobParameters parameters;
  parameters.volume = "abc";
  parameters.callback = Callback{"https://receiver.example/?key=1"};
  const json job = json::parse(to_json(parameters));
  json mesh = json::parse(to_json(mesh_parameters(parameters)));
  for (const std::string name : {"volume", "priority", "callback"}) {
    EXPECT_TRUE(job.contains(name)) << name;
    EXPECT_FALSE(mesh.contains(name)) << name;
    mesh[name] = job[name];
  }
  EXPECT_EQ(mesh, job);
}

TEST(Parameters, ReadInWords) {
  EXPECT_EQ(range_of({.name = "x"}), "");
  EXPECT_EQ(range_of({.name = "x", .minimum = 0, .maximum = 1000}), "from 0 to 1000");
  EXPECT_EQ(range_of({.name = "x", .above = 0, .maximum = 0.5}), "above 0 and at most 0.5");
  EXPECT_EQ(range_of({.name = "x", .minimum = -1}), "of at least -1");
  EXPECT_EQ(range_of({.name = "x", .above = 2}), "above 2");
  EXPECT_EQ(range_of({.name = "x", .maximum = 2}), "of at most 2");
  EXPECT_EQ(number_text(4294967295), "4294967295");
  EXPECT_EQ(number_text(1'000'000), "1000000");
  EXPECT_EQ(number_text(0.33), "0.33");
  EXPECT_EQ(listed({}), "");
  EXPECT_EQ(listed({"a"}), "a");
  EXPECT_EQ(listed({"a", "b", "c"}), "a, b or c");
  EXPECT_EQ(option_name_of({.name = "max_displacement_mm", .unit = "mm"}), "max-displacement");
  EXPECT_EQ(option_name_of({.name = "keep", .option = "keep-components"}), "keep-components");
  EXPECT_EQ(option_name_of({.name = "formats", .query = "format"}), "format");
}

}  // namespace
}  // namespace isomesh
