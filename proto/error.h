// What errors are called and which HTTP status they have, and how they cross the wire.
#pragma once

#include <string>
#include <string_view>
#include <vector>

#include "base/error.h"

namespace isomesh {

// What a code is called and which status it has. `name` is stable and ends the problem's `type`.
struct ErrorDescription {
  ErrorCode code;
  int status;
  std::string_view name;
  std::string_view title;
};

// Constant time; every code has a description.
const ErrorDescription& describe(ErrorCode code);

// The code with that name; kInternal for a name that this version does not know.
ErrorCode error_code_of(std::string_view name);

// RFC 9457 problem details: what an Error becomes on the wire.
struct Problem {
  std::string type;
  std::string title;
  int status = 0;
  std::string detail;
  std::string instance;  // the request's path or the job's; may be empty
  std::vector<FieldError> errors;
  Remedy remedy = {};  // on the wire its members stand among these

  bool operator==(const Problem&) const = default;
};

// The problem of an error. The detail of a kInternal error is replaced by a general sentence.
Problem to_problem(const Error& error, const std::string& instance);

// The inverse, for clients: an Error whose code follows from the problem's type.
Error to_error(const Problem& problem);

}  // namespace isomesh
