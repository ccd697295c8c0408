// Tests of the answers to requests whose handlers throw.
#include <filesystem>
#include <string>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "base/log.h"
#include "server/http/app/app.h"
#include "server/store/files/data_folder.h"
#include "tests/support/files.h"

namespace isomesh::http {
namespace {

using testing::HasSubstr;
using testing::IsEmpty;
using testing::Not;

struct Guarded {
  Response response;
  std::string log;
};

template <class Thrown>
Guarded guard(const Thrown& thrown, bool is_folder_away = false) {
  const test::TemporaryFolder parent;
  const store::DataFolder folder(parent / "data");
  if (is_folder_away) std::filesystem::rename(parent / "data", parent / "away");
  Guarded result;
  Request request;
  request.path = "/v1/jobs/1/mesh.obj";
  request.context.route = "/v1/jobs/{id}/mesh.{format}";
  start_log(LogFormat::kText, LogLevel::kInfo);
  testing::internal::CaptureStderr();
  guarded(folder, request, result.response, [&]() -> std::optional<Continuation> { throw thrown; });
  result.log = testing::internal::GetCapturedStderr();
  start_log(LogFormat::kText, LogLevel::kOff);
  return result;
}

TEST(GuardedRequest, HidesTheReasonOfItsOwnFailure) {
  const auto [response, log] = guard(Error(ErrorCode::kInternal, "the secret"));
  EXPECT_EQ(response.status, 500);
  EXPECT_THAT(response.body, Not(HasSubstr("the secret")));
  EXPECT_THAT(log, HasSubstr("the secret"));
}

// A path is the client's.
TEST(GuardedRequest, IsLoggedWithItsRoute) {
  const auto [response, log] = guard(Error(ErrorCode::kInternal, "the reason"));
  EXPECT_THAT(log, HasSubstr("/v1/jobs/{id}/mesh.{format} failed"));
  EXPECT_THAT(log, Not(HasSubstr("/v1/jobs/1")));
}

TEST(GuardedRequest, IsToComeAgainWhileTheDataFolderIsMissing) {
  const auto [response, log] = guard(Error(ErrorCode::kInternal, "the secret"), true);
  EXPECT_EQ(response.status, 503);
  EXPECT_THAT(response.body, HasSubstr("missing"));
  EXPECT_THAT(log, HasSubstr("the secret"));
}

TEST(GuardedRequest, AnswersWithTheProblemOfAFailedJob) {
  Problem problem = to_problem(Error(ErrorCode::kInternal, ""), "/v1/jobs/1");
  problem.detail = "the process was killed";
  const auto [response, log] = guard(RecordedProblem(problem));
  EXPECT_EQ(response.status, 500);
  EXPECT_THAT(response.body, HasSubstr("the process was killed"));
  EXPECT_THAT(response.body, HasSubstr("/v1/jobs/1/mesh.obj"));
  EXPECT_THAT(log, IsEmpty());
}

}  // namespace
}  // namespace isomesh::http
