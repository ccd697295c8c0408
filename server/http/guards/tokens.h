// Authentication: bearer tokens from a file of their hashes.
#pragma once

#include <atomic>
#include <cstdint>
#include <filesystem>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include <sys/types.h>

#include "base/mutex.h"
#include "proto/error.h"
#include "server/http/requests/request.h"

namespace isomesh::http {

// The reader of a file of tokens: the service, or an administrator, who may be root while the
// service runs as the user who owns the file.
enum class ReadBy { kService, kAdministrator };

// The tokens of a file, one per line: NAME ROLE HASH. Blank lines and lines that begin with # are
// skipped. Several lines with the same name and role are several tokens of one owner, so a token
// can be replaced without interruption. HASH is the token's SHA-256 in hexadecimal. A token has 256
// random bits, which no dictionary or brute force finds, so a slow hash would add nothing.
//
// Thread safe.
class Tokens {
 public:
  // Throws Error kInvalidParameter with the number of the invalid line (never its text), or if
  // users other than the owner may write to the file.
  explicit Tokens(const std::filesystem::path& file, ReadBy reader = ReadBy::kService);

  // Rereads the file. If that throws, the tokens stay unchanged.
  void reload();

  // Grows with each reload.
  std::uint64_t loads() const { return loads_; }

  // Returns the token's owner. Its time depends on the token's length only: all entries are
  // compared, each in constant time.
  std::optional<Caller> find(std::string_view token) const;

 private:
  struct Entry {
    Caller caller;
    std::string hash;  // of the token, in hexadecimal
  };
  using Entries = std::vector<Entry>;

  Entries read() const;

  const std::filesystem::path file_;
  const ReadBy reader_;
  mutable Mutex mutex_;
  std::shared_ptr<const Entries> entries_ ISOMESH_GUARDED_BY(mutex_);
  std::atomic<std::uint64_t> loads_ = 1;
};

// True if `owner` may own a file of tokens: root, or the service's user. The owner can write to the
// file, and so appoint administrators.
bool may_own_tokens(uid_t owner, uid_t service);

// The token of an Authorization header; empty unless its scheme is Bearer.
std::optional<std::string> bearer_of(std::string_view authorization);

// Returns a new token; token_line() makes its line for the file.
std::string make_token();
// Throws Error kInvalidParameter unless the name is 1 to 64 of A-Z a-z 0-9 . _ -
std::string token_line(const std::string& name, Role role, std::string_view token);

}  // namespace isomesh::http
