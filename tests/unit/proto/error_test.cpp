#include "proto/error.h"

#include <set>
#include <string>
#include <vector>

#include <gtest/gtest.h>

namespace isomesh {
namespace {

// HTTP status of each code in the contract. The switch has no default, so that the compiler reports
// a missing code.
int status_in_the_contract(ErrorCode code) {
  switch (code) {
    case ErrorCode::kInvalidParameter:
    case ErrorCode::kDigestMismatch:
      return 400;
    case ErrorCode::kUnauthorized:
      return 401;
    case ErrorCode::kForbidden:
      return 403;
    case ErrorCode::kNotFound:
      return 404;
    case ErrorCode::kMethodNotAllowed:
      return 405;
    case ErrorCode::kRequestTimeout:
      return 408;
    case ErrorCode::kNotReady:
    case ErrorCode::kCancelled:
      return 409;
    case ErrorCode::kGone:
      return 410;
    case ErrorCode::kLengthRequired:
      return 411;
    case ErrorCode::kPreconditionFailed:
      return 412;
    case ErrorCode::kTooLarge:
      return 413;
    case ErrorCode::kUriTooLong:
      return 414;
    case ErrorCode::kUnsupportedMedia:
      return 415;
    case ErrorCode::kRangeNotSatisfiable:
      return 416;
    case ErrorCode::kUnusableVolume:
    case ErrorCode::kEmptySurface:
    case ErrorCode::kKeyReused:
      return 422;
    case ErrorCode::kTooManyRequests:
      return 429;
    case ErrorCode::kHeadersTooLarge:
      return 431;
    case ErrorCode::kInternal:
      return 500;
    case ErrorCode::kPacsRefused:
      return 502;
    case ErrorCode::kUnavailable:
    case ErrorCode::kUnreachable:
    case ErrorCode::kPacsUnreachable:
    case ErrorCode::kSeriesIncomplete:
      return 503;
    case ErrorCode::kOutOfSpace:
      return 507;
  }
  return 0;
}

// The codes are numbered without gaps, and the switch above knows all of them.
std::vector<ErrorCode> all_codes() {
  std::vector<ErrorCode> codes;
  for (int number = 0; status_in_the_contract(ErrorCode{number}) != 0; ++number) {
    codes.push_back(ErrorCode{number});
  }
  return codes;
}

TEST(ErrorTable, HasEveryCodeUpToTheLast) {
  EXPECT_EQ(all_codes().back(), ErrorCode::kUnreachable);
}

TEST(ErrorTable, DescribesEveryCodeWithTheContractsStatus) {
  for (const ErrorCode code : all_codes()) {
    const ErrorDescription& row = describe(code);
    SCOPED_TRACE(row.name);
    EXPECT_EQ(row.code, code);
    EXPECT_EQ(row.status, status_in_the_contract(code));
    EXPECT_FALSE(row.title.empty());
  }
}

TEST(ErrorTable, NamesAreUniqueAndFitIntoAUrn) {
  std::set<std::string_view> names;
  for (const ErrorCode code : all_codes()) {
    const std::string_view name = describe(code).name;
    EXPECT_TRUE(names.insert(name).second) << name;
    EXPECT_FALSE(name.empty());
    EXPECT_EQ(name.find_first_not_of("abcdefghijklmnopqrstuvwxyz-"), std::string_view::npos)
        << name;
  }
}

TEST(ErrorTable, CodesAreFoundByTheirNames) {
  for (const ErrorCode code : all_codes()) EXPECT_EQ(error_code_of(describe(code).name), code);
  EXPECT_EQ(error_code_of("from-a-later-version"), ErrorCode::kInternal);
  EXPECT_EQ(error_code_of(""), ErrorCode::kInternal);
}

TEST(InvalidParameter, NamesItsField) {
  const Error error = invalid_parameter("iso", "must be a number");
  EXPECT_EQ(error.code(), ErrorCode::kInvalidParameter);
  EXPECT_STREQ(error.what(), "iso: must be a number");
  EXPECT_EQ(error.fields(), (std::vector<FieldError>{{"iso", "must be a number"}}));
}

TEST(ToProblem, CarriesEverythingOfTheError) {
  const Error error(ErrorCode::kUnusableVolume, "slice 41 of 93 is missing",
                    {{"file", "is incomplete"}});
  const Problem problem = to_problem(error, "/v1/volumes");
  EXPECT_EQ(problem.type, "urn:isomesh:problem:unusable-volume");
  EXPECT_EQ(problem.title, "The volume cannot be used");
  EXPECT_EQ(problem.status, 422);
  EXPECT_EQ(problem.detail, "slice 41 of 93 is missing");
  EXPECT_EQ(problem.instance, "/v1/volumes");
  EXPECT_EQ(problem.errors, error.fields());
}

TEST(ToProblem, KeepsTheDetailOfAnInternalErrorBack) {
  const Problem problem = to_problem(Error(ErrorCode::kInternal, "open /var/lib/secret"), "/v1/x");
  EXPECT_EQ(problem.status, 500);
  EXPECT_EQ(problem.detail.find("secret"), std::string::npos);
  EXPECT_FALSE(problem.detail.empty());
}

TEST(ToError, IsTheInverseForEveryCode) {
  for (const ErrorCode code : all_codes()) {
    const Error error = to_error(to_problem(Error(code, "a detail", {{"a", "b"}}), "/v1/x"));
    SCOPED_TRACE(describe(code).name);
    EXPECT_EQ(error.code(), code);
    EXPECT_EQ(error.fields(), (std::vector<FieldError>{{"a", "b"}}));
    const bool told = std::string(error.what()) == "a detail";
    EXPECT_EQ(told, code != ErrorCode::kInternal);
  }
}

TEST(ToError, TakesTheTitleWhereThereIsNoDetail) {
  Problem problem;
  problem.title = "Bad Gateway";
  EXPECT_STREQ(to_error(problem).what(), "Bad Gateway");
}

TEST(ToError, ForeignTypesAreInternal) {
  for (const std::string type :
       {"", "about:blank", "urn:isomesh:problem:", "https://a/not-found", "not-found"}) {
    Problem problem;
    problem.type = type;
    problem.status = 404;
    EXPECT_EQ(to_error(problem).code(), ErrorCode::kInternal) << type;
  }
}

}  // namespace
}  // namespace isomesh
