// Engines store times as microseconds since 1970.
#pragma once

#include <algorithm>
#include <chrono>
#include <cstdint>
#include <string_view>

#include "base/clock.h"
#include "server/store/expiry.h"

namespace isomesh::store {

inline std::int64_t to_us(Time time) {
  return std::chrono::duration_cast<std::chrono::microseconds>(time.time_since_epoch()).count();
}

// A damaged number may be beyond what the clock can tell; it becomes the first or the last time.
inline Time from_us(std::int64_t us) {
  return Time(std::chrono::microseconds(std::clamp(us, to_us(Time::min()), to_us(Time::max()))));
}

// The inverse of timestamp() of base/clock.h; 0 for an invalid text.
inline std::int64_t us_of_timestamp(std::string_view text) { return to_us(time_of(text)); }

}  // namespace isomesh::store
