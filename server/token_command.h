#pragma once

#include <filesystem>
#include <string>

namespace isomesh {

// What `isomeshd token` was asked for.
struct TokenRequest {
  std::string name;
  std::string role = "user";
  std::filesystem::path file;  // to append to; empty: the line is printed
};

// Makes a token and prints it, which is the only time that it is seen: its line for the file holds
// the hash. Throws Error kInvalidParameter, and kInternal when the file cannot be written.
void make_token(const TokenRequest& request);

}  // namespace isomesh
