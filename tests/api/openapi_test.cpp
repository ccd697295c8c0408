// The public description against the running server, both ways.
#include "tests/api/openapi.h"

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
#include "tests/api/problems.h"
#include "tests/support/enumerators.h"
#include "tests/support/nifti.h"

namespace isomesh {
namespace {

using namespace test;
using nlohmann::json;
using testing::IsEmpty;

TEST_F(OpenApiTest, IsServedAsItWasWritten) {
  const Answer answer = daemon_.get("/openapi.yaml");
  EXPECT_EQ(answer.status, 200);
  EXPECT_EQ(answer.header("content-type"), "application/yaml");
  EXPECT_TRUE(answer.body == read_file(ISOMESH_OPENAPI));
}

// The stream of all jobs ends only for a client that has gone.
Answer answer_from(const std::string& url, const std::string& method, const std::string& target) {
  const Connection connection(url);
  connection.send(request(method, target));
  if (target == "/v1/events") connection.finish_sending();
  return connection.receive();
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
      const Answer answer = answer_from(daemon_.url(), method, example);
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
      }
    }
  }
}

TEST_F(OpenApiTest, AnswersAreWhatTheSchemasSay) {
  EXPECT_THAT(faults(daemon_.get("/v1/volumes").body, "VolumeList"), IsEmpty());
  EXPECT_THAT(faults(daemon_.get("/v1/volumes/" + job_.parameters.volume).body, "Volume"),
              IsEmpty());
  EXPECT_THAT(faults(daemon_.get("/v1/jobs").body, "JobList"), IsEmpty());
  EXPECT_THAT(faults(daemon_.get("/v1/jobs/" + job_.id).body, "Job"), IsEmpty());
  EXPECT_THAT(faults(daemon_.get("/v1/jobs/0123").body, "Problem"), IsEmpty());
  EXPECT_THAT(faults(daemon_.get("/v1/orders").body, "OrderList"), IsEmpty());
  EXPECT_THAT(faults(daemon_.get("/v1/orders/" + order_.id).body, "Order"), IsEmpty());
  EXPECT_THAT(faults(daemon_.get("/v1/pacs").body, "PacsList"), IsEmpty());
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

// Holds the members of values that have all of them between them against the schema's, level by
// level.
class MemberCheck {
 public:
  explicit MemberCheck(const OpenApi& api) : api_(api) {}

  void expect_all() const {
    for (const auto& [where, members] : members_) {
      EXPECT_EQ(members.second, members.first) << where;
    }
  }

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
    auto& [known, seen] = members_[where];
    known = described;
    for (const auto& [name, unused] : value.items()) seen.insert(name);
  }

  const OpenApi& api_;
  // By their place: those that are described, and those that some value had.
  std::map<std::string, std::pair<std::set<std::string>, std::set<std::string>>> members_;
};

// A schema that asked for nothing, or named what is never there, would pass all of the above.
TEST_F(OpenApiTest, TheMembersAreThoseOfTheTypes) {
  Job job = job_;
  job.parameters.components = {1, 1, {{1, 2, 3}}};
  job.parameters.max_error_mm = 0.1;
  job.parameters.triangles = 1000;
  job.parameters.lods = {1, 0.5};
  job.parameters.merge = true;
  job.parameters.glb_codec = GlbCodec::kMeshopt;
  job.parameters.space = Space::kRas;
  job.parameters.crop = Box{{{0, 0, 0}, {1, 1, 1}}};
  job.parameters.fill_cavities = true;
  job.parameters.distances = true;
  job.parameters.certify = true;
  job.parameters.min_thickness_mm = 0.4;
  job.parameters.untangle = true;
  job.parameters.inside = Inside::kBelow;
  job.mesh->empty_reason = "why";
  job.mesh->notes = {note_of(NoteCode::kThinWalls, "1 cavity")};
  job.mesh->untangled.emplace();
  job.mesh->simplified.emplace();
  job.mesh->thickness.emplace().place = {{1, 2, 3}};
  MeshCertificate& certificate = job.mesh->certificate.emplace();
  certificate.budget_mm.emplace();
  certificate.bound_mm = 0.1;  // and the opposite, to have every member
  certificate.why_unproven = "why";
  job.mesh->quality.self_intersections.emplace();
  job.parameters.callback = Callback{"https://receiver.example/"};
  job.error = to_problem(invalid_parameter("iso", "is wrong"), "/v1/jobs/x");
  job.error->remedy = {.overridable = "frame-of-reference",
                       .choices = {{"series", "1.2", "CT", SeriesFacts{}, {{1, 1, "AA=="}}}}};
  Estimate estimate;
  estimate.iso = 60;
  estimate.simplified_triangles = 7;
  estimate.bytes[MeshFormat::kDrc] = 1;
  Job by_labels = job;
  static_cast<MeshParameters&>(by_labels.parameters) = label_parameters({});
  by_labels.parameters.lambda = 0.5;
  by_labels.parameters.label_values[3] = {3, 4};
  by_labels.mesh->labels = {{.label = 3, .voxels = 1}};
  by_labels.mesh->walls_count = 1;
  by_labels.mesh->edge_contacts_count = 0;
  const std::string digest(64, 'a');
  by_labels.mesh->labels[0].files[MeshFormat::kStl] = {.bytes = 1, .sha256 = digest, .href = "/x"};
  Job many_labels = by_labels;
  many_labels.mesh->labels.clear();
  many_labels.mesh->labels_count = 257;
  Estimate of_labels = estimate;
  of_labels.labels = {{3, 12}};
  Estimate of_many_labels = estimate;
  of_many_labels.labels_count = 257;
  Volume volume = daemon_.client().volume(job_.parameters.volume);
  volume.modality = "CT";
  volume.presets = {{"bone", 250}};
  volume.ignored.emplace_back();
  volume.notes = {note_of(NoteCode::kFormsDiffer, "by 3 mm")};
  volume.dicom.emplace().segments.emplace_back();
  Order order = order_;
  order.results.emplace_back();
  order.error = job.error;
  json a_report = json::parse(daemon_.get("/v1/jobs/" + job_.id + "/report").body);
  a_report["volume"] = json::parse(to_json(volume));
  const auto report_of = [&](const Job& one) {
    json report = a_report;
    report["job"] = json::parse(to_json(one));
    return report.dump();
  };
  const std::vector<std::pair<std::string, std::string>> complete = {
      {"Job", to_json(job)},
      {"JobParameters", to_json(job.parameters)},
      {"JobList", to_json(std::vector{job})},
      {"JobEvent", to_json(JobEvent{})},
      {"JobReport", report_of(job)},
      {"JobReport", report_of(by_labels)},
      {"JobReport", report_of(many_labels)},
      {"Volume", to_json(volume)},
      {"VolumeList", to_json(std::vector{volume})},
      {"UploadedVolumes", to_json(std::vector{UploadedVolume{"ct.nrrd", 201, volume, job.error}})},
      {"Histogram", to_json(Histogram{"", {0, 1}, {1}})},
      {"VolumeLabels", to_json(VolumeLabels{"", 0, {{.label = 1, .voxels = 1}}})},
      {"Estimate", to_json(estimate)},
      {"Job", to_json(by_labels)},
      {"Job", to_json(many_labels)},
      {"LabelSummaryList", to_json(by_labels.mesh->labels, "next")},
      {"WallList",
       to_json(std::vector<WallSummary>{{.a = 3, .area_mm2 = 1, .faces = 1, .a_name = "x"}}, "x")},
      {"JobParameters", to_json(by_labels.parameters)},
      {"JobList", to_json(std::vector{by_labels, many_labels})},
      {"Estimate", to_json(of_labels)},
      {"Estimate", to_json(of_many_labels)},
      {"Order", to_json(order)},
      {"OrderList", to_json(std::vector{order})},
      {"PacsList", to_json(std::vector<PacsStatus>(1))},
      {"PacsSeriesList", to_json(PacsSeriesList{.series = {PacsSeries()}})},
      {"Problem", to_json(*job.error)}};
  MemberCheck check(api_);
  for (const auto& [schema, text] : complete) {
    check.check(json::parse(text), api_.schema(schema), schema);
    const json whole = json::parse(text);
    EXPECT_THAT(api_.faults(whole, api_.schema(schema)), IsEmpty()) << schema;
    json more = whole;
    more["unknown"] = 1;
    EXPECT_FALSE(api_.faults(more, api_.schema(schema)).empty()) << schema;
  }
  check.expect_all();
  // None of an answer's members may be missing, but for those of some jobs only.
  const std::set<std::string> of_some = {"Volume dicom",          "Volume stored_axes",
                                         "Estimate iso",          "Estimate labels",
                                         "Estimate labels_count", "Estimate simplified_triangles"};
  for (const auto& [schema, text] : complete) {
    if (schema == "JobParameters" || schema == "Problem") continue;
    const json whole = json::parse(text);
    for (const auto& [member, value] : whole.items()) {
      json without = whole;
      without.erase(member);
      EXPECT_EQ(api_.faults(without, api_.schema(schema)).empty(),
                of_some.contains(schema + ' ' + member))
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
}

TEST_F(OpenApiTest, ProblemTypesAreThoseOfTheProgram) {
  std::vector<std::string> types;
  for (int number = 0; ErrorCode{number} != ErrorCode::kUnreachable; ++number) {
    types.push_back("urn:isomesh:problem:" + std::string(describe(ErrorCode{number}).name));
  }
  // The draft of resumable uploads has a type of its own.
  types.emplace_back("https://iana.org/assignments/http-problem-types#mismatching-upload-offset");
  EXPECT_EQ(texts_of(api_.schema("Problem")["properties"]["type"]["enum"]), types);
}

TEST_F(OpenApiTest, DefaultsAreThoseOfTheProgram) {
  json defaults = json::parse(to_json(label_parameters({})));
  defaults.update(json::parse(to_json(JobParameters{})));
  // These are left out where they are as by default.
  defaults["glb_codec"] = to_string(JobParameters{}.glb_codec);
  defaults["space"] = to_string(JobParameters{}.space);
  defaults["inside"] = to_string(JobParameters{}.inside);
  const YAML::Node properties = api_.schema("JobParameters")["properties"];
  int compared = 0;
  for (const auto& property : properties) {
    const auto name = property.first.as<std::string>();
    const YAML::Node schema = api_.resolved(property.second);
    if (!schema["default"] || !schema["default"].IsScalar()) continue;
    // Members that the JSON omits are false by default.
    const json value = defaults.contains(name) ? defaults[name] : json(false);
    EXPECT_EQ(schema["default"].as<std::string>(), value.is_string() ? value.get<std::string>()
                                                   : value.dump() == "1.0" ? "1"
                                                                           : value.dump())
        << name;
    ++compared;
  }
  EXPECT_GE(compared, 7);
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
