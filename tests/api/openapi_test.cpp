// The public description against the running server, both ways.
#include <algorithm>
#include <cctype>
#include <map>
#include <set>
#include <string>
#include <utility>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include "proto/json.h"
#include "tests/api/daemon.h"
#include "tests/api/problems.h"
#include "tests/api/schema.h"
#include "tests/support/nifti.h"

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

// What every operation may answer without saying so; the description's first words name them.
const std::set<int> kCommon = {401, 403, 404, 405, 408, 414, 431, 500, 503};

// What needs another daemon, a full disk or a long time; other tests see to it.
const std::set<std::string> kElsewhere = {"401", "403", "410", "503", "507", "default"};

// The statuses of requests, by operation.
class Statuses {
 public:
  explicit Statuses(const Daemon& daemon) : daemon_(daemon) {}

  // The request is the operation's; its target begins with the path, ids filled in.
  void probe(const std::string& operation, const std::string& target, const std::string& body = {},
             const Headers& headers = {}) {
    const std::string method = operation.substr(0, operation.find(' '));
    seen_[operation].insert(daemon_.send(method, target, body, headers).status);
  }
  void see(const std::string& operation, const std::string& bytes) {
    seen_[operation].insert(answer_to(daemon_.url(), bytes).status);
  }

  const std::set<int>& of(const std::string& operation) { return seen_[operation]; }

 private:
  const Daemon& daemon_;
  std::map<std::string, std::set<int>> seen_;
};

void probe_volumes(Statuses& statuses, const Job& running, const std::string& id) {
  const RawUpload sphere = sphere_upload();
  const std::string post = "POST /v1/volumes";
  statuses.probe(post, "/v1/volumes?" + sphere.query, sphere.bytes);
  statuses.probe(post, "/v1/volumes?dims=2,2,2&type=uint8", "12345678");
  statuses.probe(post, "/v1/volumes", "garbage");
  statuses.probe(post, "/v1/volumes", "");
  statuses.probe(post, "/v1/volumes", read_file(kBrainFile).substr(0, 5000));
  statuses.see(post, "POST /v1/volumes HTTP/1.1\r\nHost: localhost\r\n\r\n");
  statuses.see(post,
               "POST /v1/volumes HTTP/1.1\r\nHost: localhost\r\n"
               "Content-Length: 99999999999999\r\n\r\n");
  statuses.probe("GET /v1/volumes", "/v1/volumes");
  statuses.probe("GET /v1/volumes", "/v1/volumes?cursor=x");
  for (const std::string part : {"", "/histogram", "/slice.png"}) {
    const std::string get = "GET /v1/volumes/{id}" + part;
    statuses.probe(get, "/v1/volumes/" + id + part);
    statuses.probe(get, "/v1/volumes/" + id + part + "?x=1");
    statuses.probe(get, "/v1/volumes/0123" + part);
    statuses.probe(get, "/v1/volumes/" + id + part, {}, {{"If-None-Match", "*"}});
    statuses.probe(get, "/v1/volumes/" + id + part, {}, {{"If-Match", "\"x\""}});
  }
  const std::string erase = "DELETE /v1/volumes/{id}";
  statuses.probe(erase, "/v1/volumes/" + running.parameters.volume);
  statuses.probe(erase, "/v1/volumes/" + id + "?x=1");
  statuses.probe(erase, "/v1/volumes/" + id, {}, {{"If-Match", "\"x\""}});
  statuses.probe(erase, "/v1/volumes/" + id);
  statuses.probe(erase, "/v1/volumes/" + id);
}

void probe_jobs(Statuses& statuses, const Job& job) {
  const std::string post = "POST /v1/jobs";
  const std::string body = "{\"volume\": \"" + job.parameters.volume + "\", \"iso\": 100}";
  const Headers key = {{"Idempotency-Key", "k"}};
  statuses.probe(post, "/v1/jobs", body, key);
  statuses.probe(post, "/v1/jobs", body + ' ', key);
  statuses.probe(post, "/v1/jobs?wait=30", body);
  statuses.probe(post, "/v1/jobs", "{}");
  statuses.probe(post, "/v1/jobs", R"({"volume": "0123", "iso": 1})");
  statuses.probe(post, "/v1/jobs", std::string(70'000, ' '));
  statuses.probe(post, "/v1/jobs", body, {{"Content-Type", "text/plain"}});
  statuses.see(post, "POST /v1/jobs HTTP/1.1\r\nHost: localhost\r\n\r\n");
  statuses.probe("GET /v1/jobs", "/v1/jobs");
  statuses.probe("GET /v1/jobs", "/v1/jobs?state=x");
  statuses.probe("GET /v1/estimate", "/v1/estimate?iso=1&volume=" + job.parameters.volume);
  statuses.probe("GET /v1/estimate", "/v1/estimate?iso=1&volume=0123");
  statuses.probe("GET /v1/estimate", "/v1/estimate");
  for (const std::string method : {"GET", "DELETE"}) {
    const std::string operation = method + " /v1/jobs/{id}";
    statuses.probe(operation, "/v1/jobs/" + job.id);
    statuses.probe(operation, "/v1/jobs/" + job.id + "?x=1");
    statuses.probe(operation, "/v1/jobs/0123");
    statuses.probe(operation, "/v1/jobs/" + job.id, {}, {{"If-Match", "\"x\""}});
  }
  statuses.probe("GET /v1/jobs/{id}", "/v1/jobs/" + job.id, {}, {{"If-None-Match", "*"}});
  const std::string events = "GET /v1/jobs/{id}/events";
  statuses.probe(events, "/v1/jobs/" + job.id + "/events");
  statuses.probe(events, "/v1/jobs/" + job.id + "/events?x=1");
  statuses.probe(events, "/v1/jobs/0123/events");
  statuses.probe(events, "/v1/jobs/" + job.id + "/events", {},
                 {{"Last-Event-ID", "9999999999999999999"}});
}

void probe_meshes(Statuses& statuses, const Job& job, const Job& running) {
  const std::string get = "GET /v1/jobs/{id}/mesh.{format}";
  const std::string mesh = "/v1/jobs/" + job.id + "/mesh.drc";
  statuses.probe(get, mesh);
  statuses.probe(get, mesh + "?x=1");
  statuses.probe(get, "/v1/jobs/0123/mesh.drc");
  statuses.probe(get, "/v1/jobs/" + running.id + "/mesh.drc");
  statuses.probe(get, mesh, {}, {{"If-None-Match", "*"}});
  statuses.probe(get, mesh, {}, {{"If-Match", "\"x\""}});
  statuses.probe(get, mesh, {}, {{"Range", "bytes=0-1"}});
  statuses.probe(get, mesh, {}, {{"Range", "bytes=99999999-"}});
  const std::string post = "POST /v1/mesh";
  const RawUpload sphere = sphere_upload();
  const std::string target = "/v1/mesh?iso=100&" + sphere.query;
  statuses.probe(post, target, sphere.bytes, {{"Idempotency-Key", "m"}});
  statuses.probe(post, target + "&passes=1", sphere.bytes, {{"Idempotency-Key", "m"}});
  statuses.probe(post, "/v1/mesh", "garbage");
  statuses.probe(post, "/v1/mesh?iso=1", "garbage");
  statuses.see(post, "POST /v1/mesh?iso=1 HTTP/1.1\r\nHost: localhost\r\n\r\n");
  statuses.see(post,
               "POST /v1/mesh?iso=1 HTTP/1.1\r\nHost: localhost\r\n"
               "Content-Length: 99999999999999\r\n\r\n");
  statuses.probe("GET /livez", "/livez");
  statuses.probe("GET /readyz", "/readyz");
  statuses.probe("GET /metrics", "/metrics");
  statuses.probe("GET /openapi.yaml", "/openapi.yaml");
  statuses.probe("GET /", "/");
  statuses.probe("GET /", "/", {}, {{"If-None-Match", "*"}});
}

// Both ways: what is answered is described, and what is described is answered.
TEST_F(OpenApiTest, TheStatusesAreThoseOfTheServer) {
  const Job running = long_job(daemon_);
  Statuses statuses(daemon_);
  probe_jobs(statuses, job_);
  probe_meshes(statuses, job_, running);
  probe_volumes(statuses, running, job_.parameters.volume);
  for (const auto& path : api_.paths()) {
    for (const auto& operation : path.second) {
      std::string name = operation.first.as<std::string>();
      if (name == "parameters") continue;
      std::ranges::transform(name, name.begin(), [](char c) { return std::toupper(c); });
      name += ' ' + path.first.as<std::string>();
      std::set<std::string> described;
      for (const auto& response : operation.second["responses"]) {
        described.insert(response.first.as<std::string>());
      }
      for (const int status : statuses.of(name)) {
        EXPECT_TRUE(described.contains(std::to_string(status)) || kCommon.contains(status))
            << name << " answers " << status;
      }
      for (const std::string& status : described) {
        EXPECT_TRUE(kElsewhere.contains(status) || statuses.of(name).contains(std::stoi(status)) ||
                    name + ' ' + status == "POST /v1/mesh 409")  // cancelled while it is waited for
            << name << " never answers " << status;
      }
    }
  }
  daemon_.client().cancel(running.id);
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

// Holds the members of a value that has all of them against the schema's, level by level.
class MemberCheck {
 public:
  explicit MemberCheck(const OpenApi& api) : api_(api) {}

  void check(const json& value, const YAML::Node& node, const std::string& where) {
    const YAML::Node schema = api_.resolved(node);
    for (const YAML::Node& part : schema["allOf"]) check(value, part, where);
    for (const YAML::Node& choice : schema["oneOf"]) {
      if (api_.faults(value, choice).empty()) check(value, choice, where);
    }
    if (value.is_array() && schema["items"]) {
      for (const json& item : value) check(item, schema["items"], where + "[]");
    }
    if (!value.is_object()) return;
    if (schema["properties"]) check_members(value, schema["properties"], where);
    if (schema["additionalProperties"] && schema["additionalProperties"].IsMap()) {
      for (const json& item : value) check(item, schema["additionalProperties"], where + "{}");
    }
  }

 private:
  void check_members(const json& value, const YAML::Node& properties, const std::string& where) {
    std::set<std::string> described;
    for (const auto& property : properties) {
      const auto name = property.first.as<std::string>();
      described.insert(name);
      if (value.contains(name)) check(value[name], property.second, where + '/' + name);
    }
    std::set<std::string> there;
    for (const auto& [name, unused] : value.items()) there.insert(name);
    EXPECT_EQ(there, described) << where;
  }

  const OpenApi& api_;
};

// A schema that asked for nothing, or named what is never there, would pass all of the above.
TEST_F(OpenApiTest, TheMembersAreThoseOfTheTypes) {
  Job job = job_;
  job.parameters.components = {1, 1};
  job.parameters.callback = Callback{"https://receiver.example/"};
  job.error = to_problem(invalid_parameter("iso", "is wrong"), "/v1/jobs/x");
  Estimate estimate;
  estimate.bytes[MeshFormat::kDrc] = 1;
  Volume volume = daemon_.client().volume(job_.parameters.volume);
  volume.modality = "CT";
  volume.presets = {{"bone", 250}};
  volume.ignored.emplace_back();
  volume.dicom.emplace();
  const std::vector<std::pair<std::string, std::string>> complete = {
      {"Job", to_json(job)},
      {"JobParameters", to_json(job.parameters)},
      {"JobList", to_json(std::vector{job})},
      {"JobEvent", to_json(JobEvent{})},
      {"Volume", to_json(volume)},
      {"VolumeList", to_json(std::vector{volume})},
      {"Histogram", to_json(Histogram{"", {0, 1}, {1}})},
      {"Estimate", to_json(estimate)},
      {"Problem", to_json(*job.error)}};
  for (const auto& [schema, text] : complete) {
    MemberCheck(api_).check(json::parse(text), api_.schema(schema), schema);
    const json whole = json::parse(text);
    EXPECT_THAT(api_.faults(whole, api_.schema(schema)), IsEmpty()) << schema;
    json more = whole;
    more["unknown"] = 1;
    EXPECT_FALSE(api_.faults(more, api_.schema(schema)).empty()) << schema;
  }
  // None of an answer's members may be missing.
  for (const auto& [schema, text] : complete) {
    if (schema == "JobParameters" || schema == "Problem") continue;
    const json whole = json::parse(text);
    for (const auto& [member, value] : whole.items()) {
      json without = whole;
      without.erase(member);
      EXPECT_EQ(api_.faults(without, api_.schema(schema)).empty(), member == "dicom")
          << schema << ' ' << member;
    }
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
