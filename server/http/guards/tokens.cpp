#include "server/http/guards/tokens.h"

#include <algorithm>
#include <map>
#include <sstream>

#include <openssl/crypto.h>
#include <sys/stat.h>
#include <unistd.h>

#include "base/files.h"
#include "base/hex.h"
#include "base/ids.h"
#include "base/sha256.h"
#include "base/text.h"
#include "server/http/limits.h"

namespace isomesh::http {
namespace {

constexpr std::size_t kTokenBytes = 32;
constexpr std::string_view kTokenPrefix =
    "isomesh_";  // lets secret scanners recognise leaked tokens

bool is_name(std::string_view text) {
  return !text.empty() && text.size() <= limits::kLongestUserName &&
         std::ranges::all_of(text, is_plain);
}

bool is_hash(std::string_view hex) {
  return hex.size() == Sha256::kBytes * 2 && from_hex(hex).has_value();
}

Error at_fault(const std::string& what) { return invalid_parameter("tokens", what); }

// The hashes are harmless to read, but a writer of the file can become an administrator.
void check_only_owner_writes(const std::filesystem::path& file, ReadBy reader) {
  struct stat status = {};
  if (::stat(file.c_str(), &status) != 0) throw at_fault("the file cannot be read");
  const bool is_known_owner = may_own_tokens(status.st_uid, ::geteuid());
  if (!is_known_owner && !(reader == ReadBy::kAdministrator && ::geteuid() == 0)) {
    throw at_fault("the file belongs to another user: chown it to root or to the service's user");
  }
  if ((status.st_mode & (S_IWGRP | S_IWOTH)) != 0) {
    throw at_fault("other users may write to the file: run chmod go-w on it");
  }
}

}  // namespace

bool may_own_tokens(uid_t owner, uid_t service) { return owner == 0 || owner == service; }

Tokens::Tokens(const std::filesystem::path& file, ReadBy reader)
    : file_(file), reader_(reader), entries_(std::make_shared<const Entries>(read())) {}

void Tokens::reload() {
  auto entries = std::make_shared<const Entries>(read());
  const Lock lock(mutex_);
  entries_ = std::move(entries);
  ++loads_;
}

std::optional<Caller> Tokens::find(std::string_view token) const {
  std::shared_ptr<const Entries> entries;
  {
    const Lock lock(mutex_);
    entries = entries_;
  }
  const std::string hash = sha256_of(token);
  const Entry* found = nullptr;
  for (const Entry& entry : *entries) {
    if (CRYPTO_memcmp(entry.hash.data(), hash.data(), hash.size()) == 0) found = &entry;
  }
  return found == nullptr ? std::nullopt : std::optional(found->caller);
}

Tokens::Entries Tokens::read() const {
  check_only_owner_writes(file_, reader_);
  Entries entries;
  std::map<std::string, Role> roles;
  std::istringstream lines(read_whole(file_));
  std::string line;
  for (int number = 1; std::getline(lines, line); ++number) {
    std::istringstream words(line);
    std::string name;
    std::string role_name;
    std::string hex;
    std::string more;
    words >> name >> role_name >> hex >> more;
    if (name.empty() || name.starts_with('#')) continue;
    const auto role = role_from(role_name);
    if (!is_name(name) || !role || !is_hash(hex) || !more.empty()) {
      throw at_fault("line " + std::to_string(number) + " is not NAME ROLE HASH");
    }
    if (roles.emplace(name, *role).first->second != *role) {
      throw at_fault("line " + std::to_string(number) + " gives a name a second role");
    }
    entries.push_back({{name, *role}, hex});
  }
  // With authentication and no tokens the daemon would reject everybody.
  if (entries.empty()) throw at_fault("the file contains no token");
  return entries;
}

std::optional<std::string> bearer_of(std::string_view authorization) {
  constexpr std::string_view kScheme = "bearer ";
  if (lower(authorization.substr(0, kScheme.size())) != kScheme) return std::nullopt;
  const std::size_t begin = authorization.find_first_not_of(' ', kScheme.size());
  if (begin == std::string_view::npos) return std::nullopt;
  const std::string_view token =
      authorization.substr(begin, authorization.find_last_not_of(' ') + 1 - begin);
  if (token.size() > limits::kLongestToken) return std::nullopt;
  return std::string(token);
}

std::string make_token() { return std::string(kTokenPrefix) + random_hex(kTokenBytes); }

std::string token_line(const std::string& name, Role role, std::string_view token) {
  if (!is_name(name)) {
    throw invalid_parameter("name", "must have 1 to 64 of the letters A-Z a-z 0-9 . _ -");
  }
  return name + ' ' + std::string(to_string(role)) + ' ' + sha256_of(token);
}

}  // namespace isomesh::http
