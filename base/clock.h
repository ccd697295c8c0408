#pragma once

#include <chrono>
#include <optional>
#include <string>
#include <string_view>

namespace isomesh {

// The present time as RFC 3339 in UTC, with milliseconds. Thread safe.
std::string timestamp();

std::string timestamp_of(std::chrono::system_clock::time_point time);

// The inverse of timestamp_of; the beginning of 1970 for an invalid text, and for a year that the
// clock cannot have: before 1970 or after 2261.
std::chrono::system_clock::time_point time_of(std::string_view timestamp);

// The same for a time that a person gives: empty for an invalid text. For a year that the clock
// cannot have, the nearest time that it can: the beginning of 1970 or the end of 2261.
std::optional<std::chrono::system_clock::time_point> nearest_time_of(std::string_view timestamp);

// In UTC, in strftime's format, up to 39 characters. Thread safe.
std::string utc_text(std::chrono::system_clock::time_point time, const char* format);

// For a Date field (RFC 9110, 5.6.7): "Sun, 06 Nov 1994 08:49:37 GMT". Thread safe.
std::string http_date_of(std::chrono::system_clock::time_point time);

}  // namespace isomesh
