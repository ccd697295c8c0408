#include "base/ids.h"

#include <algorithm>
#include <array>
#include <cstdint>
#include <cstdio>
#include <mutex>

#include <openssl/rand.h>
#include <unistd.h>

#include "base/error.h"
#include "base/hex.h"

namespace isomesh {

std::string random_hex(std::size_t bytes) {
  std::string raw(bytes, '\0');
  auto* data = reinterpret_cast<unsigned char*>(raw.data());
  if (RAND_bytes(data, static_cast<int>(bytes)) != 1) {
    throw Error(ErrorCode::kInternal, "the system's random source failed");
  }
  return to_hex(raw);
}

std::string host_name() {
  std::array<char, 256> name = {};
  return ::gethostname(name.data(), name.size() - 1) == 0 ? name.data() : "-";
}

namespace {

// The milliseconds since 1970 and a counter in the twelve bits after them, which orders the ids of
// one millisecond (RFC 9562, section 6.2, method 1).
std::int64_t first_stamp_at(std::chrono::system_clock::time_point time) {
  constexpr int kCounterBits = 12;
  const auto since_1970 = std::chrono::floor<std::chrono::milliseconds>(time.time_since_epoch());
  return since_1970.count() << kCounterBits;
}

std::string hex_of(std::int64_t stamp) {
  std::array<char, 20> digits = {};
  std::snprintf(digits.data(), digits.size(), "%015llx", static_cast<unsigned long long>(stamp));
  return digits.data();
}

}  // namespace

std::string first_id_at(std::chrono::system_clock::time_point time) {
  const std::string digits = hex_of(std::max<std::int64_t>(first_stamp_at(time), 0));
  return digits.substr(0, 8) + '-' + digits.substr(8, 4);
}

std::string time_ordered_id(std::chrono::system_clock::time_point now) {
  static std::mutex mutex;
  static std::int64_t last_stamp = 0;
  std::int64_t stamp = first_stamp_at(now);
  {
    const std::lock_guard lock(mutex);
    stamp = std::max(stamp, last_stamp + 1);
    last_stamp = stamp;
  }
  const std::string time = hex_of(stamp);
  const std::string random = random_hex(8);
  return time.substr(0, 8) + '-' + time.substr(8, 4) + "-7" + time.substr(12, 3) + "-a" +
         random.substr(0, 3) + '-' + random.substr(3, 12);
}

}  // namespace isomesh
