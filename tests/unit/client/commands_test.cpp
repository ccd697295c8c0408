#include "client/cli/commands.h"

#include <algorithm>
#include <array>
#include <cstdio>
#include <functional>
#include <iostream>
#include <map>
#include <set>
#include <sstream>
#include <stop_token>

#include <fcntl.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <unistd.h>

#include "client/cli/exit_status.h"
#include "proto/json.h"
#include "server/hospital/command/orders.h"
#include "server/hospital/protocol/orders.h"
#include "tests/unit/client/support.h"

namespace isomesh::cli {
namespace {

using testing::HasSubstr;

struct Outcome {
  int status = 0;
  std::string out;
  std::string err;
};

Outcome outcome_of(const Options& options) {
  testing::internal::CaptureStdout();
  testing::internal::CaptureStderr();
  const int status = run(options, {});
  return {.status = status,
          .out = testing::internal::GetCapturedStdout(),
          .err = testing::internal::GetCapturedStderr()};
}

// A server with one volume "abc" and one job "7", which is `job_`.
class Commands : public testing::Test {
 protected:
  Commands() {
    server_.http.Post("/v1/volumes", [](const auto&, auto& response, const auto& read) {
      read([](const char*, std::size_t) { return true; });
      Volume volume;
      volume.id = "abc";
      response.set_content(to_json(volume), "application/json");
    });
    server_.http.Post("/v1/jobs", [this](const auto&, auto& response) {
      response.set_content(to_json(job_), "application/json");
    });
    server_.http.Get("/v1/jobs/7", [this](const auto&, auto& response) {
      if (at_a_look_) at_a_look_();
      response.set_content(to_json(job_), "application/json");
    });
    server_.http.Get("/v1/jobs/7/mesh.drc", [this](const auto&, auto& response) {
      response.set_content(mesh_, "application/octet-stream");
    });
    test::write_file(folder_ / "head.nii", "volume");
    options_.server = server_.start();
    options_.command = Command::kMesh;
    options_.files = {folder_ / "head.nii"};
    options_.outputs = {{.path = folder_ / "head.drc", .format = MeshFormat::kDrc}};
  }

  // The commands keep their options, so each run has commands of its own.
  Outcome outcome_of_added(const std::string& name, const std::vector<std::string>& words) const {
    const Added added = order_commands();
    std::vector<const char*> arguments = {"isomesh", name.c_str()};
    for (const std::string& word : words) arguments.push_back(word.c_str());
    Options options = parse_options(static_cast<int>(arguments.size()), arguments.data(), added);
    options.server = options_.server;
    return outcome_of(options);
  }

  Job job_ = test::finished_job("7", "mesh");
  std::string mesh_ = "mesh";
  std::function<void()> at_a_look_;  // runs when the job is asked for
  test::TemporaryFolder folder_;
  test::FakeServer server_;
  Options options_;
};

TEST_F(Commands, AServerThatGoesAwayLeavesAJobToComeBackTo) {
  job_.state = JobState::kRunning;
  job_.mesh.reset();
  at_a_look_ = [&] { server_.http.stop(); };
  const Outcome outcome = outcome_of(options_);
  EXPECT_EQ(outcome.status, kServerUnreachable);
  EXPECT_THAT(outcome.err, HasSubstr(options_.server));
  EXPECT_THAT(outcome.err, HasSubstr(" wait 7\n"));
  EXPECT_THAT(outcome.err, HasSubstr(" fetch 7 -o OUT"));
}

// During the submission: the server has the job, but its response did not come.
TEST_F(Commands, AnInterruptCancelsTheJobUnlessItHasEnded) {
  std::map<JobState, std::stop_source> stops = {{JobState::kRunning, {}},
                                                {JobState::kSucceeded, {}}};
  std::vector<std::string> keys;
  int cancelled = 0;
  server_.http.set_pre_routing_handler([&](const auto& request, auto&) {
    if (request.path == "/v1/jobs") {
      keys.push_back(request.get_header_value("Idempotency-Key"));
      stops.at(job_.state).request_stop();
    }
    return httplib::Server::HandlerResponse::Unhandled;
  });
  server_.http.Delete("/v1/jobs/7", [&](const auto&, auto& response) {
    ++cancelled;
    response.set_content(to_json(job_), "application/json");
  });
  for (auto& [state, stop] : stops) {
    job_.state = state;
    keys.clear();
    testing::internal::CaptureStderr();
    EXPECT_EQ(run(options_, stop.get_token()), kRefused);
    EXPECT_EQ(testing::internal::GetCapturedStderr(),
              std::string("isomesh: interrupted; the job 7 ") +
                  (state == JobState::kRunning ? "was cancelled\n" : "had already ended\n"));
    EXPECT_EQ(std::set(keys.begin(), keys.end()).size(), 1U) << "a repetition has the same key";
  }
  EXPECT_EQ(cancelled, 2);
}

TEST_F(Commands, NothingOfAServerControlsTheTerminal) {
  server_.http.set_pre_routing_handler([](const auto&, auto& response) {
    Remedy remedy{.overridable = "c\x1b", .choices = {{"member", "a\x1b[31m.nrrd", "x\ny\a"}}};
    test::answer_with(
        response,
        Error(ErrorCode::kUnusableVolume, "line\n\x1b[2J").with_remedy(std::move(remedy)));
    return httplib::Server::HandlerResponse::Handled;
  });
  EXPECT_EQ(outcome_of(options_).err,
            "isomesh: line\n\uFFFD[2J\n"
            "    --member 'a\uFFFD[31m.nrrd'  # x\uFFFDy\uFFFD\n  --accept 'c\uFFFD'\n");
}

TEST_F(Commands, NothingOfAPacsControlsTheTerminal) {
  Order order;
  order.id = "8";
  order.state = OrderState::kFailed;
  order.error = to_problem(Error(ErrorCode::kPacsRefused, "no\x1b[2J"), "");
  order.created = "today";
  order.source.pacs = "main\x1b[2J";
  order.source.study = "1.2\x1b[2J";
  order.rule = "bones\x1b[2J";
  server_.http.Get("/v1/orders", [&](const auto&, auto& response) {
    response.set_content(to_json(std::vector{order}), "application/json");
  });
  server_.http.Get("/v1/pacs", [](const auto&, auto& response) {
    const PacsStatus main{.name = "main", .last_failure = "today", .reason = "no\x1b[2J"};
    response.set_content(to_json(std::vector{main}), "application/json");
  });
  const Added added = order_commands();
  options_.command = Command::kAdded;
  std::map<std::string, std::string> told;
  for (const AddedCommand& each : added.commands) {
    if (each.name == "order") continue;
    options_.added = &each;
    told[each.name] = outcome_of(options_).out;
  }
  EXPECT_EQ(told["orders"],
            "8 failed: no\uFFFD[2J\n"
            "  ordered today from main\uFFFD[2J, study 1.2\uFFFD[2J, rule bones\uFFFD[2J\n");
  EXPECT_EQ(told["pacs"], "main  last success never  last failure today (no\uFFFD[2J)\n");
}

TEST_F(Commands, OrdersListsShowsCancelsAndRetries) {
  Order order;
  order.id = "8";
  order.created = "today";
  order.source.pacs = "main";
  order.source.study = "1.2";
  order.next_attempt = "soon";
  std::vector<std::string> asked;
  server_.http.Get("/v1/orders", [&](const auto& request, auto& response) {
    asked.push_back(request.target);
    response.set_content(to_json(std::vector{order}, "more"), "application/json");
  });
  const auto one = [&](const auto& request, auto& response) {
    asked.push_back(request.method + ' ' + request.path);
    response.set_content(to_json(order), "application/json");
  };
  server_.http.Get("/v1/orders/8", one);
  server_.http.Delete("/v1/orders/8", one);
  server_.http.Post("/v1/orders/8/retry", one);
  const auto run_with = [&](const std::vector<std::string>& words) {
    return outcome_of_added("orders", words);
  };
  const std::string shown =
      "8 waiting\n  ordered today from main, study 1.2\n  next attempt soon\n";
  const Outcome list = run_with({"--state", "waiting", "--rule", "bone", "--cursor", "c"});
  EXPECT_EQ(list.out, shown);
  EXPECT_EQ(list.err, "More: isomesh orders --cursor more\n");
  EXPECT_EQ(run_with({"8"}).out, shown);
  EXPECT_EQ(run_with({"8", "--cancel", "--json"}).out, to_json(order) + '\n');
  EXPECT_EQ(run_with({"8", "--retry"}).out, shown);
  EXPECT_THAT(asked, testing::IsSupersetOf({"/v1/orders?state=waiting&rule=bone&cursor=c",
                                            "GET /v1/orders/8", "DELETE /v1/orders/8",
                                            "POST /v1/orders/8/retry"}));
}

TEST_F(Commands, ReportPrintsOrWritesWhatTheServerTells) {
  server_.http.Get("/v1/jobs/7/report", test::answering(R"({"job": "7"})"));
  Options options = test::options_from({"report", "7"});
  options.server = options_.server;
  EXPECT_EQ(outcome_of(options).out, "{\"job\": \"7\"}\n");
  options.report = folder_ / "report.json";
  EXPECT_EQ(outcome_of(options).out, "");
  EXPECT_EQ(test::read_file(options.report), "{\"job\": \"7\"}\n");
}

TEST_F(Commands, PacsSearchesOneForSeries) {
  httplib::Params asked;
  PacsSeriesList found = {.series = {{.study = "1.2",
                                      .series = "1.3",
                                      .patient_id = "PAT-1",
                                      .patient_name = "Doe^Jane\x1b[2J",
                                      .study_date = "20261130",
                                      .study_description = "Head",
                                      .series_description = "bone",
                                      .modality = "CT",
                                      .instances = 54},
                                     {.study = "1.2", .series = "1.4"}},
                          .complete = false};
  server_.http.Get("/v1/pacs/main/series", [&](const auto& request, auto& response) {
    asked = request.params;
    response.set_content(to_json(found), "application/json");
  });
  const auto run_with = [&](std::vector<std::string> words) {
    words.insert(words.begin(), "main");
    return outcome_of_added("pacs", words);
  };
  const Outcome table = run_with({"--patient-name", "Doe*", "--modality", "CT", "--limit", "7"});
  EXPECT_EQ(table.status, kDone);
  EXPECT_EQ(table.out,
            "  DATE      ID     PATIENT       MODALITY  IMAGES  STUDY  SERIES  UIDS\n"
            "  20261130  PAT-1  Doe^Jane\uFFFD[2J  CT            54  Head   bone    1.2 1.3\n"
            "                                                ?                 1.2 1.4\n");
  EXPECT_THAT(table.err, HasSubstr("The PACS has more"));
  EXPECT_EQ(asked, (httplib::Params{{"patient_name", "Doe*"}, {"modality", "CT"}, {"limit", "7"}}));
  EXPECT_EQ(run_with({"--study", "1.2", "--json"}).out, to_json(found) + '\n');
  found = {};
  const Outcome none = run_with({"--date", "20261130"});
  EXPECT_EQ(none.out, "");
  EXPECT_EQ(none.err, "The PACS has no such series\n");
  EXPECT_EQ(test::end_of({"pacs", "--study", "1.2"}).first, kWrongUsage);
}

TEST_F(Commands, QuietSaysNothing) {
  options_.quiet = true;
  const Outcome outcome = outcome_of(options_);
  EXPECT_EQ(outcome.status, kDone);
  EXPECT_EQ(outcome.out + outcome.err, "");
  EXPECT_EQ(test::read_file(folder_ / "head.drc"), "mesh");
}

TEST_F(Commands, AnEmptySurfaceWritesNothingUnlessThatIsAccepted) {
  job_.mesh->empty = true;
  job_.mesh->empty_reason = "the labels have none";
  test::write_file(folder_ / "head.drc", "old");
  const Outcome refused = outcome_of(options_);
  EXPECT_EQ(refused.status, kRefused);
  EXPECT_THAT(refused.err, HasSubstr("the surface is empty: the labels have none; --allow-empty"));
  EXPECT_EQ(refused.out, "");
  EXPECT_EQ(test::read_file(folder_ / "head.drc"), "old");
  options_.json = true;
  EXPECT_THAT(outcome_of(options_).out, HasSubstr("\"outputs\":[]"));
  options_.outputs = {{.path = folder_ / "new" / "{name}.drc", .format = MeshFormat::kDrc}};
  EXPECT_EQ(outcome_of(options_).status, kRefused);
  EXPECT_FALSE(std::filesystem::exists(folder_ / "new"));
  Options fetching = options_;
  fetching.command = Command::kFetch;
  fetching.id = "7";
  fetching.outputs = {{.path = folder_ / "fetched.drc", .format = MeshFormat::kDrc}};
  EXPECT_EQ(outcome_of(fetching).status, kRefused);
  EXPECT_FALSE(std::filesystem::exists(folder_ / "fetched.drc"));
  Options telling = fetching;
  telling.command = Command::kStatus;
  telling.json = false;
  EXPECT_THAT(outcome_of(telling).out, HasSubstr("empty: the labels have none"));
  Options piped = options_;
  piped.json = false;
  piped.outputs = {{.path = "-", .format = MeshFormat::kDrc}};
  EXPECT_EQ(outcome_of(piped).out, "");
  options_.allow_empty = fetching.allow_empty = true;
  EXPECT_EQ(outcome_of(options_).status, kDone);
  EXPECT_EQ(test::read_file(folder_ / "new" / "head.drc"), "mesh");
  EXPECT_EQ(outcome_of(fetching).status, kDone);
  EXPECT_EQ(test::read_file(folder_ / "fetched.drc"), "mesh");
}

TEST_F(Commands, NotesOnTheMeshAreToldWhereverTheMeshGoes) {
  job_.mesh->notes = {{.code = "thin-walls", .detail = "A cavity is open. scheme=5 closes it."}};
  const std::string told = "note: A cavity is open. --scheme 5 closes it. (thin-walls)\n";
  EXPECT_THAT(outcome_of(options_).out, HasSubstr("(thin-walls)"));
  Options piped = options_;
  piped.outputs = {{.path = "-", .format = MeshFormat::kDrc}};
  const Outcome streamed = outcome_of(piped);
  EXPECT_EQ(streamed.out, "mesh");
  EXPECT_THAT(streamed.err, HasSubstr(told));
  Options fetching = options_;
  fetching.command = Command::kFetch;
  fetching.id = "7";
  EXPECT_THAT(outcome_of(fetching).err, HasSubstr(told));
  fetching.quiet = piped.quiet = true;
  EXPECT_EQ(outcome_of(fetching).err + outcome_of(piped).err, "");
}

TEST_F(Commands, EachLineOfJsonSaysItsInput) {
  const std::string good = folder_ / "head.nii";
  const std::string bad = folder_ / "bad.nii";
  std::filesystem::create_symlink("bad.nii", bad);  // a loop, which cannot be read
  options_.files = {good, bad};
  options_.outputs = {{.path = folder_ / "{name}.drc", .format = MeshFormat::kDrc}};
  options_.json = true;
  const Outcome outcome = outcome_of(options_);
  EXPECT_EQ(outcome.status, kRefused);
  std::istringstream lines(outcome.out);
  std::string first;
  std::string second;
  std::getline(lines, first);
  std::getline(lines, second);
  EXPECT_THAT(first, HasSubstr("\"input\":\"" + good + '"'));
  EXPECT_THAT(first, HasSubstr("\"state\":\"succeeded\""));
  EXPECT_THAT(second, HasSubstr("\"input\":\"" + bad + '"'));
  EXPECT_THAT(second, HasSubstr("\"error\":{\"type\":"));
  EXPECT_THAT(second, HasSubstr("bad.nii: "));

  std::filesystem::last_write_time(
      good, std::filesystem::file_time_type::clock::now() - std::chrono::hours(1));
  options_.skip_existing = true;
  const Outcome again = outcome_of(options_);
  EXPECT_THAT(again.out, HasSubstr("{\"skipped\":true,\"outputs\":[\"" +
                                   (folder_ / "head.drc").string() + "\"],\"input\":\"" + good));
  EXPECT_THAT(again.err, HasSubstr("skipped 1 of 2 inputs"));
}

// The first part of a large mesh fits into a pipe that nobody reads, as it does on a disk that is
// nearly full.
TEST_F(Commands, AMeshThatIsCutOffOnStandardOutputFails) {
  mesh_.assign(std::size_t{4} << 20, 'm');
  job_ = test::finished_job("7", mesh_);
  options_.outputs = {{.path = "-", .format = MeshFormat::kDrc}};
  std::array<int, 2> pipe = {};
  ASSERT_EQ(::pipe2(pipe.data(), O_NONBLOCK | O_CLOEXEC), 0);
  std::fflush(stdout);
  const int kept = ::dup(STDOUT_FILENO);
  ::dup2(pipe[1], STDOUT_FILENO);
  testing::internal::CaptureStderr();
  const int status = run(options_, {});
  const std::string told = testing::internal::GetCapturedStderr();
  std::cout.clear();
  ::dup2(kept, STDOUT_FILENO);
  for (const int file : {kept, pipe[0], pipe[1]}) ::close(file);
  EXPECT_EQ(status, kRefused);
  EXPECT_THAT(told, HasSubstr("standard output cannot be written to"));
}

TEST_F(Commands, AMeshDoesNotOverwriteAVolume) {
  test::write_file(folder_ / "head.vtk", "volume");
  options_.files = {folder_ / "head.vtk"};
  options_.outputs = {{.path = folder_ / "{name}.vtk", .format = MeshFormat::kVtk}};
  EXPECT_THROW(run(options_, {}), EarlyExit);
  EXPECT_EQ(test::read_file(folder_ / "head.vtk"), "volume");
}

TEST_F(Commands, StatusAnswersWhateverTheStateIs) {
  options_.command = Command::kStatus;
  options_.id = "7";
  job_.state = JobState::kCancelled;
  job_.mesh.reset();
  EXPECT_EQ(outcome_of(options_).status, kDone);
  options_.command = Command::kWait;
  const Outcome waited = outcome_of(options_);
  EXPECT_EQ(waited.status, kRefused);
  EXPECT_EQ(waited.err, "isomesh: the job was cancelled\n");
}

}  // namespace
}  // namespace isomesh::cli
