#pragma once

#include <memory>
#include <string>
#include <string_view>

namespace isomesh {

// A SHA-256 that is fed piece by piece. One thread at a time.
class Sha256 {
 public:
  Sha256();
  ~Sha256();
  Sha256(const Sha256&) = delete;
  Sha256& operator=(const Sha256&) = delete;

  void update(std::string_view bytes);

  // Ends the digest; to be called once, and nothing after it.
  std::string finish();  // 32 bytes

 private:
  struct State;
  std::unique_ptr<State> state_;
};

std::string to_hex(std::string_view bytes);     // lower case
std::string to_base64(std::string_view bytes);  // RFC 4648, padded

}  // namespace isomesh
