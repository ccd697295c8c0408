// The wall clock as text.
#pragma once

#include <string>

namespace isomesh {

// The present time as RFC 3339 in UTC, with milliseconds. Thread safe.
std::string timestamp();

}  // namespace isomesh
