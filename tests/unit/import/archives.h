// Archives as programs write them.
#pragma once

#include <string>
#include <string_view>
#include <vector>

namespace isomesh::import::test {

struct Member {
  enum class Kind { kFile, kFolder, kLink, kHardLink, kDevice };

  std::string name;
  std::string bytes;  // or what a link points to
  Kind kind = Kind::kFile;
};

enum class Locked { kNo, kYes };

std::string zip(const std::vector<Member>& members, Locked locked = Locked::kNo);
std::string tar(const std::vector<Member>& members);

// A TAR whose member `name` is a file with an empty name, under a checksum that is right.
std::string without_name(std::string tar, std::string_view name);

}  // namespace isomesh::import::test
