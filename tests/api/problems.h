// Checks that a response is a complete problem document.
#pragma once

#include <string>

#include <gtest/gtest.h>

#include "proto/error.h"
#include "proto/json.h"
#include "tests/api/http.h"

namespace isomesh::test {

// A complete problem of that code whose words tell nothing of the machine.
inline testing::AssertionResult is_problem(const Answer& answer, ErrorCode code) {
  const ErrorDescription& expected = describe(code);
  const auto failure = [&] {
    return testing::AssertionFailure() << answer.status << ' ' << answer.body << ": ";
  };
  if (answer.status != expected.status) return failure() << "not " << expected.status;
  if (answer.header("content-type") != "application/problem+json") return failure() << "its type";
  if (answer.header("x-content-type-options") != "nosniff") return failure() << "no nosniff";
  const Problem problem = problem_from_json(answer.body);
  if (problem.status != expected.status || problem.title != expected.title ||
      problem.type != "urn:isomesh:problem:" + std::string(expected.name)) {
    return failure() << "its code is not " << expected.name;
  }
  if (problem.detail.empty()) return failure() << "no detail";
  for (const std::string trace :
       {"/tmp", "isomesh-test", "/data/", "scratch", "blobs", "std::", "0x", "errno", ".cpp"}) {
    if (answer.body.find(trace) != std::string::npos) return failure() << "tells " << trace;
  }
  return testing::AssertionSuccess();
}

// The same, with this field among those at fault.
inline testing::AssertionResult blames(const Answer& answer, const std::string& field) {
  const auto result = is_problem(answer, ErrorCode::kInvalidParameter);
  if (!result) return result;
  for (const FieldError& error : problem_from_json(answer.body).errors) {
    if (error.field == field) return testing::AssertionSuccess();
  }
  return testing::AssertionFailure() << answer.body << ": does not name " << field;
}

}  // namespace isomesh::test
