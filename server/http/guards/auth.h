// Who may ask what: bearer tokens from a file that holds their hashes.
#pragma once

#include <array>
#include <filesystem>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include <sys/types.h>

#include "base/mutex.h"
#include "proto/error.h"
#include "server/http/requests/caller.h"

namespace isomesh::http {

std::string_view to_string(Role role);
std::optional<Role> role_from(std::string_view name);

// Who reads a file of tokens: the service, or somebody who looks after it and may be root, while
// the service runs as another user, to whom the file may belong.
enum class ReadBy { kService, kAdministrator };

// The tokens of a file, one a line: NAME ROLE HASH. Blank lines and those that begin with # are
// skipped; several lines of one name and one role are several tokens of one owner, so that a token
// can be replaced without a gap. HASH is the token's SHA-256 in hexadecimal: a token has 256 random
// bits, which no dictionary holds and nobody can try through, so a slow hash would add nothing.
//
// Thread safe.
class Tokens {
 public:
  // Throws Error kInvalidParameter that names the line at fault (never its text), or says that
  // somebody else than the owner may write to the file.
  explicit Tokens(const std::filesystem::path& file, ReadBy reader = ReadBy::kService);

  // Reads the file again. When that throws, the tokens stay as they were.
  void reload();

  std::size_t count() const;

  // Whose token that is. Takes the same time for every token of one length: all entries are
  // compared, each in constant time.
  std::optional<Caller> find(std::string_view token) const;

 private:
  struct Entry {
    Caller caller;
    std::array<std::uint8_t, 32> hash;
  };
  using Entries = std::vector<Entry>;

  Entries read() const;

  const std::filesystem::path file_;
  const ReadBy reader_;
  mutable Mutex mutex_;
  std::shared_ptr<const Entries> entries_ ISOMESH_GUARDED_BY(mutex_);
};

// Whether a file of tokens may belong to that user: to root, or to whom the service runs as. The
// owner of a file can write to it, and makes an administrator of whomever it likes.
bool may_own_tokens(uid_t owner, uid_t service);

// The token of an Authorization header; empty when there is none of the scheme Bearer.
std::optional<std::string> bearer_of(std::string_view authorization);

// A new token, and the line that a file of tokens needs to know it.
std::string make_token();
// Throws Error kInvalidParameter for a name that is not 1 to 64 of A-Z a-z 0-9 . _ -
std::string token_line(const std::string& name, Role role, std::string_view token);

}  // namespace isomesh::http
