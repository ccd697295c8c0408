// Error codes: their names, their HTTP status and their form on the wire.
#pragma once

#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "base/error.h"

namespace isomesh {

// `name` is stable; it ends the problem's `type`.
struct ErrorDescription {
  ErrorCode code;
  int status;
  std::string_view name;
  std::string_view title;
};

// One for every code.
std::span<const ErrorDescription> error_descriptions();

// Constant time; every code has a description.
const ErrorDescription& describe(ErrorCode code);

// Returns kInternal for a name that this version does not know.
ErrorCode error_code_of(std::string_view name);
// The first code with that status; kInternal if there is none.
ErrorCode error_code_of_status(int status);

// RFC 9457 problem details: what an Error becomes on the wire.
struct Problem {
  std::string type;
  std::string title;
  int status = 0;
  std::string detail;
  std::string instance;  // path of the request or the job; may be empty
  std::vector<FieldError> errors;
  Remedy remedy = {};  // its members are written beside the others

  bool operator==(const Problem&) const = default;
};

// Replaces the detail of a kInternal error with a general sentence.
Problem to_problem(const Error& error, const std::string& instance);

// The inverse, for clients. The code follows from the problem's type.
Error to_error(const Problem& problem);

}  // namespace isomesh
