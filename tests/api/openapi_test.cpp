// The public description against the running server, both ways.
#include <set>
#include <string>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include "proto/json.h"
#include "tests/api/daemon.h"
#include "tests/api/problems.h"
#include "tests/api/schema.h"

namespace isomesh {
namespace {

using namespace test;
using nlohmann::json;
using testing::IsEmpty;

// All names of an enumeration whose values are numbered without gaps.
template <class Enum>
std::vector<std::string> names() {
  std::vector<std::string> all;
  for (int number = 0; !to_string(Enum{number}).empty(); ++number) {
    all.emplace_back(to_string(Enum{number}));
  }
  return all;
}

std::string replaced(std::string text, const std::string& from, const std::string& to) {
  const std::size_t found = text.find(from);
  return found == std::string::npos ? text : text.replace(found, from.size(), to);
}

class OpenApiTest : public testing::Test {
 protected:
  std::vector<std::string> faults(const std::string& body, const std::string& schema) {
    return api_.faults(json::parse(body), api_.schema(schema));
  }

  // The methods of a path as the server's Allow header would name them.
  static std::set<std::string> methods_of(const YAML::Node& path_item) {
    std::set<std::string> methods;
    if (path_item["get"]) methods.insert({"GET", "HEAD"});
    if (path_item["post"]) methods.insert("POST");
    if (path_item["delete"]) methods.insert("DELETE");
    return methods;
  }

  // A path with the ids of what is there.
  std::string example_of(const std::string& path) {
    const bool of_volume = path.starts_with("/v1/volumes");
    const std::string& id = of_volume ? job_.parameters.volume : job_.id;
    return replaced(replaced(path, "{format}", "drc"), "{id}", id);
  }

  Daemon daemon_;
  const Job job_ = finished_job(daemon_);
  const OpenApi api_{daemon_.get("/openapi.yaml").body};
};

TEST_F(OpenApiTest, IsServedAsItWasWritten) {
  const Answer answer = daemon_.get("/openapi.yaml");
  EXPECT_EQ(answer.status, 200);
  EXPECT_EQ(answer.header("content-type"), "application/yaml");
  EXPECT_TRUE(answer.body == read_file(ISOMESH_OPENAPI));
  EXPECT_LT(answer.body.size(), 65536U);
}

TEST_F(OpenApiTest, EveryMethodOfEveryPathIsServedAndNoOther) {
  for (const auto& path : api_.paths()) {
    const std::string example = example_of(path.first.as<std::string>());
    const std::set<std::string> described = methods_of(path.second);
    std::string allowed;
    for (const std::string& method : described) {
      allowed += (allowed.empty() ? "" : ", ") + method;
    }
    for (const std::string method : {"GET", "POST", "DELETE", "PUT", "PATCH"}) {
      if (method == "DELETE" && described.contains(method)) continue;  // is tried last
      const Answer answer = daemon_.send(method, example);
      EXPECT_NE(answer.status, 404) << method << ' ' << example;
      EXPECT_EQ(answer.status != 405, described.contains(method)) << method << ' ' << example;
      if (answer.status == 405) {
        EXPECT_EQ(answer.header("allow"), allowed) << example;
      }
    }
  }
  for (const std::string& path : {"/v1/jobs/" + job_.id, "/v1/volumes/" + job_.parameters.volume}) {
    EXPECT_LT(daemon_.send("DELETE", path).status, 300) << path;
  }
}

TEST_F(OpenApiTest, EveryParameterIsKnown) {
  for (const auto& path : api_.paths()) {
    for (const auto& operation : path.second) {
      const auto method = operation.first.as<std::string>();
      if (method != "get" && method != "post") continue;
      for (const YAML::Node& reference : operation.second["parameters"]) {
        const YAML::Node parameter = api_.resolved(reference);
        if (parameter["in"].as<std::string>() != "query") continue;
        const auto name = parameter["name"].as<std::string>();
        const Answer answer =
            daemon_.send(method == "get" ? "GET" : "POST",
                         example_of(path.first.as<std::string>()) + '?' + name + "=1");
        EXPECT_EQ(answer.body.find("is not a parameter"), std::string::npos)
            << path.first << ' ' << name << ": " << answer.body;
        EXPECT_EQ(answer.body.find("is not a known member"), std::string::npos)
            << path.first << ' ' << name << ": " << answer.body;
      }
    }
  }
}

TEST_F(OpenApiTest, EveryStatusThatIsAnsweredIsDescribed) {
  const auto expect = [&](const Answer& answer, const std::string& path,
                          const std::string& method) {
    const YAML::Node responses = api_.paths()[path][method]["responses"];
    EXPECT_TRUE(responses[std::to_string(answer.status)])
        << method << ' ' << path << ": " << answer.status;
  };
  const RawUpload sphere = sphere_upload();
  const std::string job = "/v1/jobs/" + job_.id;
  expect(daemon_.send("POST", "/v1/volumes?" + sphere.query, sphere.bytes), "/v1/volumes", "post");
  expect(daemon_.send("POST", "/v1/volumes", "garbage"), "/v1/volumes", "post");
  expect(daemon_.send("POST", "/v1/volumes", ""), "/v1/volumes", "post");
  expect(daemon_.get("/v1/volumes"), "/v1/volumes", "get");
  expect(daemon_.get("/v1/volumes/0123"), "/v1/volumes/{id}", "get");
  expect(daemon_.send("DELETE", "/v1/volumes/0123"), "/v1/volumes/{id}", "delete");
  expect(daemon_.send("POST", "/v1/jobs", "{}"), "/v1/jobs", "post");
  expect(daemon_.send("POST", "/v1/jobs", R"({"volume": "0123", "iso": 1})"), "/v1/jobs", "post");
  expect(daemon_.get("/v1/jobs?state=x"), "/v1/jobs", "get");
  expect(daemon_.get("/v1/jobs/0123"), "/v1/jobs/{id}", "get");
  expect(daemon_.send("DELETE", job), "/v1/jobs/{id}", "delete");
  const std::string mesh = "/v1/jobs/{id}/mesh.{format}";
  expect(daemon_.get(job + "/mesh.drc"), mesh, "get");
  expect(daemon_.get(job + "/mesh.stl"), mesh, "get");
  expect(daemon_.get(job + "/mesh.drc", {{"If-None-Match", "*"}}), mesh, "get");
  expect(daemon_.get(job + "/mesh.drc", {{"Range", "bytes=0-1"}}), mesh, "get");
  expect(daemon_.get(job + "/mesh.drc", {{"Range", "bytes=99999999-"}}), mesh, "get");
  expect(daemon_.send("POST", "/v1/mesh?iso=1", "garbage"), "/v1/mesh", "post");
  expect(daemon_.get("/livez"), "/livez", "get");
  expect(daemon_.get("/readyz"), "/readyz", "get");
}

TEST_F(OpenApiTest, AnswersAreWhatTheSchemasSay) {
  EXPECT_THAT(faults(daemon_.get("/v1/volumes").body, "VolumeList"), IsEmpty());
  EXPECT_THAT(faults(daemon_.get("/v1/volumes/" + job_.parameters.volume).body, "Volume"),
              IsEmpty());
  EXPECT_THAT(faults(daemon_.get("/v1/jobs").body, "JobList"), IsEmpty());
  EXPECT_THAT(faults(daemon_.get("/v1/jobs/" + job_.id).body, "Job"), IsEmpty());
  EXPECT_THAT(faults(daemon_.get("/v1/jobs/0123").body, "Problem"), IsEmpty());
  EXPECT_THAT(faults(daemon_.send("POST", "/v1/jobs", "{}").body, "Problem"), IsEmpty());
}

TEST_F(OpenApiTest, JobsOfEveryStateAreWhatTheSchemaSays) {
  const Job running = long_job(daemon_);
  EXPECT_THAT(faults(daemon_.get("/v1/jobs/" + running.id).body, "Job"), IsEmpty());
  daemon_.client().cancel(running.id);
  EXPECT_THAT(faults(daemon_.get("/v1/jobs/" + running.id + "?wait=30").body, "Job"), IsEmpty());
  Job failed = running;
  failed.state = JobState::kFailed;
  failed.error = to_problem(Error(ErrorCode::kTooLarge, "too large"), "/v1/jobs/x");
  EXPECT_THAT(faults(to_json(failed), "Job"), IsEmpty());
}

// The other way round: a schema that asked for nothing would pass all of the above.
TEST_F(OpenApiTest, TheSchemasAskForEveryMember) {
  const std::string volume = daemon_.get("/v1/volumes/" + job_.parameters.volume).body;
  const std::string job = daemon_.get("/v1/jobs/" + job_.id).body;
  for (const auto& [schema, body] : {std::pair{"Volume", volume}, std::pair{"Job", job}}) {
    const json whole = json::parse(body);
    for (const auto& [member, value] : whole.items()) {
      json without = whole;
      without.erase(member);
      EXPECT_FALSE(api_.faults(without, api_.schema(schema)).empty()) << schema << ' ' << member;
    }
    json more = whole;
    more["unknown"] = 1;
    EXPECT_FALSE(api_.faults(more, api_.schema(schema)).empty()) << schema;
  }
}

TEST_F(OpenApiTest, EnumerationsAreThoseOfTheProgram) {
  const auto listed = [&](const std::string& schema) {
    return texts_of(api_.schema(schema)["enum"]);
  };
  EXPECT_EQ(listed("SampleType"), names<SampleType>());
  EXPECT_EQ(listed("Interpolation"), names<Interpolation>());
  EXPECT_EQ(listed("Smoothing"), names<Smoothing>());
  EXPECT_EQ(listed("MeshFormat"), names<MeshFormat>());
  EXPECT_EQ(listed("Priority"), names<Priority>());
  EXPECT_EQ(listed("JobState"), names<JobState>());
  EXPECT_EQ(listed("Stage"), names<Stage>());
}

TEST_F(OpenApiTest, ProblemTypesAreThoseOfTheProgram) {
  std::vector<std::string> types;
  for (int number = 0; ErrorCode{number} != ErrorCode::kUnreachable; ++number) {
    types.push_back("urn:isomesh:problem:" + std::string(describe(ErrorCode{number}).name));
  }
  EXPECT_EQ(texts_of(api_.schema("Problem")["properties"]["type"]["enum"]), types);
}

TEST_F(OpenApiTest, DefaultsAreThoseOfTheProgram) {
  const json defaults = json::parse(to_json(JobParameters{}));
  const YAML::Node properties = api_.schema("JobParameters")["properties"];
  int compared = 0;
  for (const auto& property : properties) {
    const auto name = property.first.as<std::string>();
    const YAML::Node schema = api_.resolved(property.second);
    if (!schema["default"] || schema["default"].IsSequence()) continue;
    const json value = defaults[name];
    EXPECT_EQ(schema["default"].as<std::string>(), value.is_string() ? value.get<std::string>()
                                                   : value.dump() == "1.0" ? "1"
                                                                           : value.dump())
        << name;
    ++compared;
  }
  EXPECT_GE(compared, 7);
}

// Ranges, one step inside and one outside.
TEST_F(OpenApiTest, RangesAreThoseOfTheProgram) {
  const auto takes = [&](const std::string& name, double value) {
    json body = {{"volume", "0123"}, {"iso", 1}};
    const bool of_draco = name == "position_bits" || name == "speed";
    const bool of_components = name == "keep" || name == "min_triangles";
    json& owner = of_draco ? body["draco"] : of_components ? body["components"] : body;
    owner[name] = value;
    return daemon_.send("POST", "/v1/jobs", body.dump()).status != 400;
  };
  for (const auto& [name, schema] :
       {std::pair{"passes", "Passes"}, std::pair{"position_bits", "PositionBits"},
        std::pair{"speed", "Speed"}, std::pair{"keep", "Keep"},
        std::pair{"min_triangles", "MinTriangles"}}) {
    const auto low = api_.schema(schema)["minimum"].as<double>();
    const auto high = api_.schema(schema)["maximum"].as<double>();
    EXPECT_TRUE(takes(name, low) && takes(name, high)) << name;
    EXPECT_FALSE(takes(name, low - 1) || takes(name, high + 1)) << name;
  }
  EXPECT_TRUE(takes("lambda", 1));
  EXPECT_FALSE(takes("lambda", 0) || takes("lambda", 1.001));
  EXPECT_TRUE(takes("pass_band", 0.5));
  EXPECT_FALSE(takes("pass_band", 0) || takes("pass_band", 0.501));
  EXPECT_TRUE(takes("max_displacement_mm", 0));
  EXPECT_FALSE(takes("max_displacement_mm", -1e-9));
}

TEST_F(OpenApiTest, EveryNameIsTaken) {
  for (const std::string& name : names<Smoothing>()) {
    const json body = {{"volume", job_.parameters.volume}, {"iso", 100}, {"smoothing", name}};
    EXPECT_EQ(daemon_.send("POST", "/v1/jobs", body.dump()).status, 202) << name;
  }
}

TEST_F(OpenApiTest, TheExamplesAreRequestsThatAreUnderstood) {
  const YAML::Node examples =
      api_.paths()["/v1/jobs"]["post"]["requestBody"]["content"]["application/json"]["examples"];
  for (const auto& example : examples) {
    json body = json_of(example.second["value"]);
    EXPECT_THAT(api_.faults(body, api_.schema("JobRequest")), IsEmpty());
    body["volume"] = job_.parameters.volume;
    EXPECT_EQ(daemon_.send("POST", "/v1/jobs", body.dump()).status, 202) << body;
  }
  EXPECT_GE(examples.size(), 2U);
}

TEST_F(OpenApiTest, TheExamplesFitTheirSchemas) {
  EXPECT_THAT(api_.faults(json_of(api_.schema("Volume")["example"]), api_.schema("Volume")),
              IsEmpty());
}

}  // namespace
}  // namespace isomesh
