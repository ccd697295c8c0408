#include "server/http/observe/metrics.h"

#include <algorithm>
#include <map>
#include <regex>
#include <sstream>
#include <string>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "server/http/requests/request.h"

namespace isomesh::http {
namespace {

using testing::AllOf;
using testing::ContainsRegex;
using testing::EndsWith;
using testing::HasSubstr;
using testing::Not;

TEST(Metrics, AreOpenMetrics) {
  const Metrics metrics;
  const std::string text = metrics.text({}, MetricsFormat::kOpenMetrics);
  EXPECT_THAT(text, EndsWith("\n# EOF\n"));
  EXPECT_THAT(text, HasSubstr("# TYPE isomesh_jobs_ended counter\n"));
  EXPECT_THAT(text, HasSubstr("# HELP isomesh_jobs_ended Ended jobs"));
  EXPECT_THAT(text, HasSubstr("\nisomesh_jobs_ended_total{state=\"failed\"} 0\n"));
  EXPECT_THAT(text, Not(ContainsRegex("# [A-Z]+ [a-z_]+_total ")));
  EXPECT_THAT(text,
              ContainsRegex("\nisomesh_build_info\\{mesher=\"[0-9]+\",version=\"[0-9.]+\"\\} 1\n"));
}

TEST(Metrics, CountRequestsByRouteAndClassOfStatus) {
  Metrics metrics;
  const AnsweredRequest request = {.method = "GET",
                                   .route = "/v1/jobs/{id}",
                                   .status = 404,
                                   .seconds = 0.02,
                                   .bytes_in = 3,
                                   .bytes_out = 70};
  metrics.count(request);
  metrics.count(request);
  EXPECT_THAT(
      metrics.text({}, MetricsFormat::kOpenMetrics),
      AllOf(
          HasSubstr("isomesh_http_requests_total{method=\"GET\",route=\"/v1/jobs/{id}\","
                    "status=\"4xx\"} 2\n"),
          HasSubstr("isomesh_http_request_seconds_count{route=\"/v1/jobs/{id}\"} 2\n"),
          HasSubstr("isomesh_http_request_seconds_bucket{route=\"/v1/jobs/{id}\",le=\"0.01\"} 0\n"),
          HasSubstr(
              "isomesh_http_request_seconds_bucket{route=\"/v1/jobs/{id}\",le=\"0.025\"} 2\n"),
          HasSubstr("isomesh_http_received_bytes_total 6\n"),
          HasSubstr("isomesh_http_sent_bytes_total 140\n")));
}

// A client must not be able to make the daemon keep a counter for each word that it invents.
TEST(Metrics, WhatClientsInventIsOneLabel) {
  Metrics metrics;
  for (const std::string method : {"BREW", "MAKE\"}", "X"}) {
    metrics.count({.method = method, .route = kNoRoute, .status = 999});
  }
  EXPECT_THAT(metrics.text({}, MetricsFormat::kOpenMetrics),
              HasSubstr("isomesh_http_requests_total{method=\"other\",route=\"none\","
                        "status=\"other\"} 3\n"));
}

TEST(Metrics, CountJobsByTheirEndAndTheirStages) {
  Metrics metrics;
  Job job;
  job.state = JobState::kSucceeded;
  job.timing.encode = 40;
  job.mesh.emplace().triangles = 1000;
  metrics.count_ended(job);
  Job failed;
  failed.state = JobState::kFailed;
  failed.error = to_problem(Error(ErrorCode::kTooLarge, "too many triangles"), "");
  metrics.count_ended(failed);
  metrics.count_refused(ErrorCode::kUnusableVolume);
  EXPECT_THAT(metrics.text({}, MetricsFormat::kOpenMetrics),
              AllOf(HasSubstr("isomesh_jobs_ended_total{state=\"succeeded\"} 1\n"),
                    HasSubstr("isomesh_jobs_ended_total{state=\"failed\"} 1\n"),
                    HasSubstr("isomesh_job_failures_total{reason=\"too-large\"} 1\n"),
                    HasSubstr("isomesh_job_stage_seconds_count{stage=\"encode\"} 1\n"),
                    HasSubstr("isomesh_job_stage_seconds_bucket{stage=\"encode\",le=\"0.05\"} 1\n"),
                    HasSubstr("isomesh_job_triangles_total 1000\n"),
                    HasSubstr("isomesh_imports_refused_total{reason=\"unusable-volume\"} 1\n")));
}

TEST(Metrics, TellTheLevelsAndTheProcess) {
  const Metrics metrics;
  EXPECT_THAT(
      metrics.text({.queued = {1, 2, 3},
                    .running = 4,
                    .waiting_for_disk = 2,
                    .disk_free_bytes = 5'000'000'000},
                   MetricsFormat::kOpenMetrics),
      AllOf(HasSubstr("isomesh_queued_jobs{priority=\"stat\"} 1\n"),
            HasSubstr("isomesh_queued_jobs{priority=\"bulk\"} 3\n"),
            HasSubstr("isomesh_running_jobs 4\n"), HasSubstr("isomesh_jobs_waiting_for_disk 2\n"),
            HasSubstr("isomesh_disk_free_bytes 5000000000\n"),
            ContainsRegex("process_resident_memory_bytes [1-9]"),
            ContainsRegex("process_open_fds [1-9]"), ContainsRegex("process_threads [1-9]")));
}

TEST(Metrics, CountFailuresFromTheStart) {
  Metrics metrics;
  metrics.expect("POST", "/v1/jobs");
  metrics.expect("", kNoRoute);
  const std::string text = metrics.text({}, MetricsFormat::kOpenMetrics);
  for (const ErrorDescription& error : error_descriptions()) {
    const std::string reason = "{reason=\"" + std::string(error.name) + "\"} 0\n";
    EXPECT_THAT(text, HasSubstr("\nisomesh_job_failures_total" + reason));
    EXPECT_THAT(text, HasSubstr("\nisomesh_imports_refused_total" + reason));
  }
  const std::string requests = "\nisomesh_http_requests_total{method=\"";
  EXPECT_THAT(text, HasSubstr(requests + "POST\",route=\"/v1/jobs\",status=\"5xx\"} 0\n"));
  EXPECT_THAT(text, HasSubstr(requests + "other\",route=\"none\",status=\"5xx\"} 0\n"));
  EXPECT_THAT(text, HasSubstr("\nisomesh_callback_attempts_total{result=\"given_up\"} 0\n"));
}

struct WrittenFamily {
  std::string help;
  std::string type;
  std::vector<std::string> samples;  // names with their labels

  bool operator==(const WrittenFamily&) const = default;
};

// Reads a text line by line, as strictly as its format says. Families by the names of their
// counters without _total, so that both formats have the same.
std::map<std::string, WrittenFamily> families_in(const std::string& text, MetricsFormat format) {
  const bool is_open = format == MetricsFormat::kOpenMetrics;
  const std::regex described("# (HELP|TYPE) ([a-z_]+) (.+)");
  const std::regex sampled("([a-z_]+)(\\{([a-z_]+=\"[^\"\\\\]*\",?)*\\})? ([-+0-9.e]+|[+]Inf)");
  std::map<std::string, WrittenFamily> families;
  std::string name;  // of the family whose samples follow
  std::istringstream lines(text);
  bool has_end = false;
  for (std::string line; std::getline(lines, line);) {
    EXPECT_FALSE(has_end) << line;
    std::smatch parts;
    if (is_open && line == "# EOF") {
      has_end = true;
    } else if (std::regex_match(line, parts, described)) {
      const bool is_new = parts[1] == "HELP";
      EXPECT_TRUE(is_new || parts[2] == name) << line;
      name = parts[2];
      EXPECT_EQ(families.contains(name), !is_new) << line;
      (is_new ? families[name].help : families[name].type) = parts[3];
    } else if (std::regex_match(line, parts, sampled)) {
      const WrittenFamily& family = families[name];
      const std::string rest = parts[1].str().substr(std::min(name.size(), parts[1].str().size()));
      EXPECT_TRUE(parts[1].str().starts_with(name)) << line;
      if (family.type == "histogram") {
        EXPECT_TRUE(rest == "_bucket" || rest == "_sum" || rest == "_count") << line;
      } else {
        EXPECT_EQ(rest, family.type == "counter" && is_open ? "_total" : "") << line;
      }
      families[name].samples.push_back(parts[1].str() + parts[2].str());
    } else {
      ADD_FAILURE() << line;
    }
  }
  EXPECT_EQ(has_end, is_open);
  EXPECT_TRUE(text.ends_with('\n'));
  if (is_open) return families;
  std::map<std::string, WrittenFamily> alike;
  for (auto& [counter, family] : families) {
    const bool is_counter = family.type == "counter";
    EXPECT_EQ(counter.ends_with("_total"), is_counter) << counter;
    alike[is_counter ? counter.substr(0, counter.rfind('_')) : counter] = family;
  }
  return alike;
}

TEST(Metrics, AreTheSameInBothFormats) {
  Metrics metrics;
  metrics.count({.method = "GET", .route = "/v1/jobs/{id}", .status = 404});
  Job job;
  job.state = JobState::kSucceeded;
  job.mesh.emplace().triangles = 1000;
  metrics.count_ended(job);
  metrics.count_refused(ErrorCode::kUnusableVolume);
  const Levels levels = {
      .others = {{.name = "isomesh_sent_total",
                  .help = "Sent objects",
                  .is_counter = true,
                  .values = {{{{"pacs", "main"}}, 3}}},
                 {.name = "isomesh_orders_paused", .help = "1 if paused", .values = {{{}, 1}}}}};
  const auto open =
      families_in(metrics.text(levels, MetricsFormat::kOpenMetrics), MetricsFormat::kOpenMetrics);
  const auto older = families_in(metrics.text(levels, MetricsFormat::kPrometheusText),
                                 MetricsFormat::kPrometheusText);
  EXPECT_GT(open.size(), 15U);
  EXPECT_TRUE(open == older);
  EXPECT_EQ(older.at("isomesh_sent").type, "counter");
}

}  // namespace
}  // namespace isomesh::http
