// The limits and times of callbacks. --callback-retry-seconds sets the first delay.
#pragma once

#include <chrono>
#include <cstddef>

namespace isomesh::callbacks::limits {

inline constexpr std::size_t kLongestUrl = 2000;

// Attempts at the same time.
inline constexpr std::size_t kAtOnce = 64;
inline constexpr std::size_t kAtOncePerReceiver = 4;

// One attempt, from resolving the name to the response.
inline constexpr std::chrono::milliseconds kTimeout{10'000};
// The back-off after a failed attempt: the first delay doubles each time, up to the longest.
inline constexpr std::chrono::milliseconds kFirstDelay{5'000};
inline constexpr std::chrono::milliseconds kLongestDelay{std::chrono::hours(1)};
inline constexpr std::chrono::milliseconds kGiveUpAfter{std::chrono::hours(24)};

// Between two looks at the outbox at most, and after the database could not be read or written.
inline constexpr std::chrono::milliseconds kLongestSleep{5'000};
inline constexpr std::chrono::milliseconds kPause{1'000};

}  // namespace isomesh::callbacks::limits
