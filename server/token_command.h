// `isomeshd token`: manages the file of tokens.
#pragma once

#include <filesystem>
#include <string>

namespace isomesh {

struct TokenRequest {
  std::string name;  // the owner; for a revocation, of which to revoke tokens
  std::string role = "user";
  std::string hash;            // for a revocation: prefix of one token's hash; empty: all
  std::filesystem::path file;  // empty for a new token: its line is printed
};

// Changes to the file are atomic and serialised, also between processes. All functions throw Error
// kInvalidParameter if the names or the file do not allow the change, and kInternal if the file
// cannot be written.

// Creates a token and prints it. It cannot be printed again: its line in the file has only the
// hash.
void add_token(const TokenRequest& request);

// Prints each token's name, role and prefix of the hash.
void list_tokens(const TokenRequest& request);

// Removes tokens from the file and prints their number. Throws if none would remain, because a
// daemon rejects such a file and keeps its old tokens.
void revoke_tokens(const TokenRequest& request);

}  // namespace isomesh
