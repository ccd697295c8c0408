#pragma once

#include <chrono>
#include <string>
#include <string_view>

namespace isomesh {

// The present time as RFC 3339 in UTC, with milliseconds. Thread safe.
std::string timestamp();

std::string timestamp_of(std::chrono::system_clock::time_point time);

// The inverse; 1970 for an invalid text.
std::chrono::system_clock::time_point time_of(std::string_view timestamp);

}  // namespace isomesh
