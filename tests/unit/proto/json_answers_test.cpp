// Answers of the server: written by it, read by clients.
#include <cmath>
#include <string>
#include <vector>

#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include "proto/json.h"
#include "proto/json_tree.h"
#include "proto/record_digest.h"
#include "tests/support/errors.h"
#include "tests/support/flips.h"
#include "tests/unit/proto/answers.h"

namespace isomesh {
namespace {

using nlohmann::json;
using test::code_thrown_by;
using test::dicom_volume;
using test::failed_job;
using test::queued_job;
using test::some_problem;
using test::some_volume;
using test::succeeded_job;

// --- Spelling ------------------------------------------------------------------------------------

TEST(AnswerJson, SpellsAMeshAsTheContractDoes) {
  json mesh = json::parse(to_json(succeeded_job()))["mesh"];
  mesh.erase("quality");
  EXPECT_EQ(mesh, json::parse(R"({
      "empty": false, "triangles": 5091320, "vertices": 2544488, "boundary_edges": 7, "components": 12,
      "euler": -35, "dropped": {"components": 3, "triangles": 48},
      "area_mm2": 593150.7, "area_extracted_mm2": 600000.5,
      "volume_mm3": {"extracted": 2795793.9, "smoothed": 2790000.25},
      "displacement_mm": {"mean": 0.25, "max": 1.75},
      "bounds": [[-1, -2, -3], [1, 2, 3]],
      "files": {"drc": {"bytes": 1, "sha256": "aa", "href": "/v1/jobs/7/mesh.drc"},
                "obj": {"bytes": 2, "sha256": "bb", "href": "/v1/jobs/7/mesh.obj"}}})"));
}

// --- Round trips ---------------------------------------------------------------------------------

TEST(AnswerJson, VolumesComeBackTheSame) {
  EXPECT_EQ(volume_from_json(to_json(some_volume())), some_volume());
  Volume empty;
  empty.id = "0";
  EXPECT_EQ(volume_from_json(to_json(empty)), empty);
  const std::vector<Volume> several = {some_volume(), empty, dicom_volume()};
  EXPECT_EQ(volumes_from_json(to_json(several)), several);
}

TEST(AnswerJson, PagesHaveTheCursorOfTheNext) {
  EXPECT_EQ(next_from_json(R"({"jobs": [], "next": "abc"})"), "abc");
  EXPECT_EQ(next_from_json(R"({"jobs": [], "next": null})"), "");
  EXPECT_EQ(next_from_json(R"({"jobs": []})"), "");
  EXPECT_EQ(next_from_json(R"({"next": 5})"), "");
  EXPECT_EQ(next_from_json("[]"), "");
}

TEST(AnswerJson, LabelsAreInRecordsAndInNoAnswer) {
  Volume volume = some_volume();
  volume.labels = {{.label = -1, .name = "rest"},
                   {.label = 2, .name = "M\xc3\xbcller", .color = "#0080ff", .values = {2, 300}}};
  const json record = json::parse(to_record(volume));
  EXPECT_EQ(record["labels"], json::parse(R"([
      {"label": -1, "name": "rest", "color": null, "values": []},
      {"label": 2, "name": "M\u00fcller", "color": "#0080ff", "values": [2, 300]}])"));
  EXPECT_EQ(volume_from_record(to_record(volume)), volume);
  EXPECT_EQ(to_json(volume), to_json(some_volume()));
  EXPECT_EQ(to_full_json(some_volume()), to_json(some_volume()));
}

TEST(AnswerJson, AColorIsSixDigits) {
  EXPECT_TRUE(is_color("#09afcd"));
  for (const char* const text : {"", "#", "09afcd", "#09afc", "#09afcd0", "#09AFCD", "#09afcg"}) {
    EXPECT_FALSE(is_color(text)) << text;
  }
}

TEST(AnswerJson, JobsComeBackTheSame) {
  const std::vector<Job> several = {queued_job(), succeeded_job(), failed_job()};
  for (const Job& job : several) EXPECT_EQ(job_from_json(to_json(job)), job);
  EXPECT_EQ(jobs_from_json(to_json(several, "next")), several);
}

TEST(AnswerJson, AJobForOtsuComesBackTheSame) {
  Job job = queued_job();
  job.parameters.iso.reset();
  EXPECT_EQ(job_from_json(to_json(job)), job);
}

TEST(AnswerJson, ProblemsComeBackTheSame) {
  EXPECT_EQ(problem_from_json(to_json(some_problem())), some_problem());
}

TEST(AnswerJson, NumbersComeBackToTheLastBit) {
  for (const double number : {0.1, 1e-300, 1.7976931348623157e308, 4.9e-324, -0.0, 1.0 / 3,
                              9007199254740993.0, std::nextafter(60.0, 61.0)}) {
    Volume volume = some_volume();
    volume.suggested_iso = number;
    const double read = volume_from_json(to_json(volume)).suggested_iso;
    EXPECT_EQ(read, number);
    EXPECT_EQ(std::signbit(read), std::signbit(number));
  }
}

TEST(AnswerJson, EveryEnumeratorComesBack) {
  for (int number = 0; !to_string(SampleType{number}).empty(); ++number) {
    Volume volume = some_volume();
    volume.type = SampleType{number};
    EXPECT_EQ(volume_from_json(to_json(volume)), volume);
  }
  for (int state = 0; !to_string(JobState{state}).empty(); ++state) {
    for (int stage = 0; !to_string(Stage{stage}).empty(); ++stage) {
      Job job;
      job.id = "0";
      job.state = JobState{state};
      job.stage = Stage{stage};
      EXPECT_EQ(job_from_json(to_json(job)), job);
    }
  }
}

TEST(AnswerJson, BytesThatAreNotUtf8AreReplaced) {
  Problem problem = some_problem();
  problem.detail = "a\xff\xc3z";
  problem.instance = "/\x80";
  const Problem read = problem_from_json(to_json(problem));
  EXPECT_EQ(read.detail.front(), 'a');
  EXPECT_EQ(read.detail.back(), 'z');
  EXPECT_EQ(read.detail.find('\xff'), std::string::npos);
}

// --- From later versions, and from nobody

TEST(AnswerJson, UnknownMembersAreIgnored) {
  json volume = json::parse(to_json(some_volume()));
  volume["owner"] = "later";
  volume["extra"] = {{"deep", {1, 2, 3}}};
  EXPECT_EQ(volume_from_json(volume.dump()), some_volume());

  json job = json::parse(to_json(succeeded_job()));
  job["worker"] = 7;
  job["parameters"]["later"] = true;
  job["timing"]["later"] = 3;
  job["mesh"]["genus"] = 1;
  job["mesh"]["files"]["usdc"] = {{"bytes", 1}};
  job["mesh"]["files"]["drc"]["later"] = 1;
  EXPECT_EQ(job_from_json(job.dump()), succeeded_job());
}

class NoAnswer : public testing::TestWithParam<std::string> {};

TEST_P(NoAnswer, IsNotWhatTheApiDescribes) {
  const std::string text = GetParam();
  EXPECT_EQ(code_thrown_by([&] { volume_from_json(text); }), ErrorCode::kInternal);
  EXPECT_EQ(code_thrown_by([&] { job_from_json(text); }), ErrorCode::kInternal);
  EXPECT_EQ(code_thrown_by([&] { problem_from_json(text); }), ErrorCode::kInternal);
  EXPECT_EQ(code_thrown_by([&] { volumes_from_json(text); }), ErrorCode::kInternal);
  EXPECT_EQ(code_thrown_by([&] { jobs_from_json(text); }), ErrorCode::kInternal);
}

INSTANTIATE_TEST_SUITE_P(Texts, NoAnswer,
                         testing::Values("", " ", "{", "}", "nul", "null", "true", "7", "\"id\"",
                                         "[]", "[{}]", "{\"id\": \"a\",}", "{'id': 'a'}", "NaN",
                                         "<!DOCTYPE html>", "{\"id\": \"\xff\"}",
                                         std::string(100'000, '['), std::string(100'000, '{')));

// Sets one member of an answer to something that it must not be.
struct Fault {
  const char* pointer;
  const char* value;
};

template <class Read>
void expect_refused(const std::string& answer, const std::vector<Fault>& faults, const Read& read) {
  for (const Fault& fault : faults) {
    json bad = json::parse(answer);
    bad[json::json_pointer(fault.pointer)] = json::parse(fault.value);
    EXPECT_EQ(code_thrown_by([&] { read(bad.dump()); }), ErrorCode::kInternal)
        << fault.pointer << ": " << fault.value;
  }
}

TEST(AnswerJson, MembersOfTheWrongKindAreRefused) {
  expect_refused(to_json(some_volume()),
                 {{"/id", "7"},
                  {"/dims", "[1]"},
                  {"/dims", "7"},
                  {"/dims/0", "\"x\""},
                  {"/type", "\"int3\""},
                  {"/type", "3"},
                  {"/spacing", "null"},
                  {"/spacing/1", "null"},
                  {"/range", "{}"},
                  {"/bytes", "\"many\""}},
                 volume_from_json);
  expect_refused(to_json(succeeded_job()),
                 {{"/state", "\"melted\""},
                  {"/state", "null"},
                  {"/stage", "\"frying\""},
                  {"/progress", "\"1\""},
                  {"/parameters", "[]"},
                  {"/parameters", "7"},
                  {"/parameters/formats", "\"drc\""},
                  {"/parameters/draco", "3"},
                  {"/timing", "[]"},
                  {"/timing", "1"},
                  {"/mesh", "[]"},
                  {"/mesh/files", "[]"},
                  {"/mesh/files/drc", "3"},
                  {"/mesh/bounds", "[]"},
                  {"/error", "\"broken\""},
                  {"/started", "3"}},
                 job_from_json);
}

TEST(AnswerJson, ListsThatAreNotListsAreRefused) {
  for (const std::string value : {"7", "null", "{}", "\"a\"", "[7]", "[null]", "[[]]", "[\"a\"]"}) {
    EXPECT_EQ(code_thrown_by([&] { volumes_from_json("{\"volumes\": " + value + "}"); }),
              ErrorCode::kInternal)
        << value;
    EXPECT_EQ(code_thrown_by([&] { jobs_from_json("{\"jobs\": " + value + "}"); }),
              ErrorCode::kInternal)
        << value;
  }
}

TEST(AnswerJson, NulByteEndsNone) {
  const std::string text = R"({"jobs": []})";
  EXPECT_TRUE(jobs_from_json(text).empty());
  EXPECT_EQ(code_thrown_by([&] { jobs_from_json(text + '\0'); }), ErrorCode::kInternal);
  EXPECT_EQ(code_thrown_by([&] { jobs_from_json(text + '\0' + text); }), ErrorCode::kInternal);
}

std::string nested(std::size_t depth) { return std::string(depth, '[') + std::string(depth, ']'); }

TEST(AnswerJson, NestingWithoutEndIsNoJson) {
  EXPECT_EQ(problem_from_json("{\"later\": " + nested(200) + "}"), Problem{});
  EXPECT_EQ(problem_from_json(R"({"later": ")" + std::string(1000, '[') + R"(\"[["})"), Problem{});
  EXPECT_EQ(code_thrown_by([] { problem_from_json("{\"later\": " + nested(200'000) + "}"); }),
            ErrorCode::kInternal);
}

// A value is written in the error's text, or to compare it.
TEST(RequestJson, NestingWithoutEndExhaustsNoStack) {
  for (const std::string name : {"scheme", "iso", "passes", "smoothing", "labels", "crop", "x"}) {
    const std::string body = R"({"volume": "a", ")" + name + "\": " + nested(500'000) + '}';
    EXPECT_EQ(code_thrown_by([&] { parse_job_parameters(body); }), ErrorCode::kInvalidParameter)
        << name;
  }
}

TEST(AnswerJson, AnObjectWithAnotherIdFailsAndIsLeftOutOfAList) {
  Volume odd = some_volume();
  odd.id = "$(id)";
  EXPECT_EQ(code_thrown_by([&] { volume_from_json(to_json(odd)); }), ErrorCode::kInternal);
  EXPECT_EQ(volumes_from_json(to_json(std::vector{odd, some_volume()})),
            std::vector{some_volume()});
}

TEST(AnswerJson, NamesOtherObjectsByTheirIds) {
  Job odd = succeeded_job();
  odd.parameters.volume = "a\x1b[2J";
  EXPECT_EQ(code_thrown_by([&] { job_from_json(to_json(odd)); }), ErrorCode::kInternal);
  EXPECT_EQ(jobs_from_json(to_json(std::vector{odd, succeeded_job()})),
            std::vector{succeeded_job()});
  EXPECT_EQ(code_thrown_by([] { histogram_from_json(R"({"volume": "../a"})"); }),
            ErrorCode::kInternal);
}

// An id is a word of a shell, a part of a path and no option.
TEST(AnswerJson, AnIdHasTheFormOfIds) {
  for (const std::string id : {"7", "abc", "0192e4b1-77c3-7000-a000-000000000000", "A-"}) {
    EXPECT_TRUE(is_id(id)) << id;
  }
  for (const std::string id : {"", "-a", "a b", "a_b", "a/b", "..", "$a", "a\n", "\u00e9"}) {
    EXPECT_FALSE(is_id(id)) << id;
  }
  EXPECT_TRUE(is_id(std::string(64, 'a')));
  EXPECT_FALSE(is_id(std::string(65, 'a')));
}

TEST(Records, AreReadBackWhole) {
  const Job job = succeeded_job();
  EXPECT_EQ(job_from_record(to_json(job)), job);
  EXPECT_EQ(job_from_record(to_json(Job{})), Job{});
}

TEST(Records, WithAWrongByteAreNoOthers) {
  Volume labelled = dicom_volume();
  labelled.labels = {{.label = 2, .name = "Liver", .color = "#0080ff", .values = {2, 300}}};
  for (const Volume& volume : {some_volume(), labelled, Volume{}}) {
    test::expect_wrong_bytes_found(to_record(volume), volume_from_record);
  }
  Job by_labels = succeeded_job();
  static_cast<MeshParameters&>(by_labels.parameters) = label_parameters({{3}});
  by_labels.parameters.label_names = {{3, "Liver"}};
  for (const Job& job : {queued_job(), succeeded_job(), failed_job(), by_labels}) {
    test::expect_wrong_bytes_found(to_record(job), job_from_record);
  }
}

TEST(Records, HaveADigestThatAnswersDoNotHave) {
  const std::string record = to_record(some_volume());
  EXPECT_EQ(json::parse(record).erase("digest"), 1U);
  EXPECT_EQ(without_digest(record), to_full_json(some_volume()));
  EXPECT_EQ(without_digest("{}"), "{}");
  std::string other = record;
  const std::size_t at = other.find("nifti");
  ASSERT_NE(at, std::string::npos);
  other.replace(at, 5, "nrrd!");
  EXPECT_EQ(code_thrown_by([&] { without_digest(other); }), ErrorCode::kInternal);
}

TEST(Records, OfAVolumeOfAnOlderVersionLackNothingThatItWrote) {
  for (const char* name : {"format", "dims", "type", "spacing", "origin", "direction", "range",
                           "suggested_iso", "bytes", "created"}) {
    json record = json::parse(to_full_json(some_volume()));
    ASSERT_EQ(record.erase(name), 1U);
    EXPECT_EQ(code_thrown_by([&] { volume_from_record(record.dump()); }), ErrorCode::kInternal)
        << name;
  }
}

TEST(Records, OfAVolumeTellTheOrderOfAxesInItsFile) {
  Volume volume = some_volume();
  volume.stored_axes = "RAS";
  EXPECT_EQ(json::parse(to_json(volume))["stored_axes"], "RAS");
  EXPECT_EQ(volume_from_record(to_record(volume)), volume);
  json older = json::parse(to_full_json(volume));
  ASSERT_EQ(older.erase("stored_axes"), 1U);
  EXPECT_EQ(volume_from_record(older.dump()).stored_axes, std::nullopt);
}

// Older versions know no digest, and keep each member as they find it.
TEST(Records, ChangedByAnOlderVersionCanBeRead) {
  JsonTree tree(to_record(queued_job()));
  json_values::assign(json_values::member(tree.root(), "state"), to_string(JobState::kCancelled));
  const std::string changed = dump(tree.root());
  Job expected = queued_job();
  expected.state = JobState::kCancelled;
  EXPECT_EQ(job_from_record(changed), expected);
  EXPECT_EQ(job_from_record(to_record(job_from_record(changed))), expected);
}

TEST(Records, OfAnOlderVersionHaveDefaultsForWhatItDidNotKnow) {
  const Job job = succeeded_job();
  json record = json::parse(to_json(job));
  record.erase("reused");
  record.erase("waiting_for");
  record["parameters"].erase("close");
  record["parameters"]["draco"].erase("speed");
  record["mesh"].erase("components");
  Job expected = job;
  expected.parameters.close = false;
  expected.parameters.draco.speed = DracoParameters{}.speed;
  expected.mesh->components = 0;
  EXPECT_EQ(job_from_record(record.dump()), expected);
  for (const std::string text : {"", "[]", "{\"id\": 7}"}) {
    EXPECT_EQ(test::code_thrown_by([&] { job_from_record(text); }), ErrorCode::kInternal) << text;
  }
}

}  // namespace
}  // namespace isomesh
