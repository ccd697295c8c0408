// SHA-256 (FIPS 180-4), by OpenSSL.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <span>
#include <string>
#include <string_view>

namespace isomesh {

// Hashes bytes incrementally. Not thread safe. All members throw Error kInternal if OpenSSL fails.
class Sha256 {
 public:
  static constexpr std::size_t kBytes = 32;
  using Digest = std::array<std::uint8_t, kBytes>;

  Sha256();
  ~Sha256();
  Sha256(Sha256&&) noexcept;
  Sha256& operator=(Sha256&&) noexcept;

  void update(std::span<const std::byte> bytes);
  void update(std::string_view bytes) { update(std::as_bytes(std::span(bytes))); }

  // Returns the digest of all bytes. Call once.
  Digest finish();

 private:
  struct State;
  std::unique_ptr<State> state_;
};

std::string sha256_of(std::string_view text);

// The bytes of HMAC-SHA-256 (RFC 2104). Throws Error kInternal if OpenSSL fails.
std::string hmac_sha256(std::string_view key, std::string_view text);

}  // namespace isomesh
