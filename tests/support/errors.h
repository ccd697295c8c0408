// Assertions on exceptions.
#pragma once

#include <functional>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include <gtest/gtest.h>

#include "proto/error.h"

namespace isomesh::test {

// The Error that `action` throws; empty if it throws nothing.
inline std::optional<Error> thrown_by(const std::function<void()>& action) {
  try {
    action();
  } catch (const Error& error) {
    return error;
  }
  return std::nullopt;
}

// The Error that `action` throws, which it has to; `row` tells one of many in a failure.
inline Error error_of(const std::function<void()>& action, std::string_view row = {}) {
  const auto error = thrown_by(action);
  if (!error) ADD_FAILURE() << "nothing was thrown: " << row;
  return error.value_or(Error(ErrorCode::kInternal, "nothing was thrown"));
}

inline std::optional<ErrorCode> code_thrown_by(const std::function<void()>& action) {
  const auto error = thrown_by(action);
  return error ? std::optional(error->code()) : std::nullopt;
}

inline std::vector<std::string> fields_of(const Error& error) {
  std::vector<std::string> names;
  for (const FieldError& field : error.fields()) names.push_back(field.field);
  return names;
}

}  // namespace isomesh::test
