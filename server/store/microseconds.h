// Engines store times as microseconds since 1970.
#pragma once

#include <chrono>
#include <cstdint>
#include <string_view>

#include "base/clock.h"
#include "server/store/expiry.h"

namespace isomesh::store {

inline std::int64_t to_us(Time time) {
  return std::chrono::duration_cast<std::chrono::microseconds>(time.time_since_epoch()).count();
}

inline Time from_us(std::int64_t us) { return Time(std::chrono::microseconds(us)); }

// The inverse of timestamp() of base/clock.h; 0 for an invalid text.
inline std::int64_t us_of_timestamp(std::string_view text) { return to_us(time_of(text)); }

}  // namespace isomesh::store
