// `isomeshd token`: the file of tokens, as an operator handles it.
#pragma once

#include <filesystem>
#include <string>

namespace isomesh {

struct TokenRequest {
  std::string name;  // whose; of a revocation, whose tokens
  std::string role = "user";
  std::string hash;            // of a revocation: the beginning of the one token's hash; empty: all
  std::filesystem::path file;  // empty, for a new token: its line is printed
};

// Changes to the file are made one after the other, also by several processes, and are there whole
// or not at all. All throw Error kInvalidParameter for what cannot be done with these names or that
// file, and kInternal when it cannot be written.

// Makes a token and prints it, which is the only time that it is seen: its line for the file holds
// the hash.
void add_token(const TokenRequest& request);

// Prints name, role and the beginning of the hash of each.
void list_tokens(const TokenRequest& request);

// Takes tokens out of the file, and says how many. Throws also where none would be left, because a
// daemon keeps those that it knows rather than read such a file.
void revoke_tokens(const TokenRequest& request);

}  // namespace isomesh
