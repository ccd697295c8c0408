#include "server/http/observe/metrics.h"

#include <string>

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
  const std::string text = metrics.text({});
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
      metrics.text({}),
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
  EXPECT_THAT(metrics.text({}),
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
  EXPECT_THAT(metrics.text({}),
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
                    .disk_free_bytes = 5'000'000'000}),
      AllOf(HasSubstr("isomesh_queued_jobs{priority=\"stat\"} 1\n"),
            HasSubstr("isomesh_queued_jobs{priority=\"bulk\"} 3\n"),
            HasSubstr("isomesh_running_jobs 4\n"), HasSubstr("isomesh_jobs_waiting_for_disk 2\n"),
            HasSubstr("isomesh_disk_free_bytes 5000000000\n"),
            ContainsRegex("process_resident_memory_bytes [1-9]"),
            ContainsRegex("process_open_fds [1-9]"), ContainsRegex("process_threads [1-9]")));
}

}  // namespace
}  // namespace isomesh::http
