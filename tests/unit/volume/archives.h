// Archives as programs write them.
#pragma once

#include <string>
#include <vector>

namespace isomesh::volume::test {

struct Member {
  enum class Kind { kFile, kFolder, kLink, kHardLink, kDevice };

  std::string name;
  std::string bytes;  // or what a link points to
  Kind kind = Kind::kFile;
};

enum class Locked { kNo, kYes };

std::string zip(const std::vector<Member>& members, Locked locked = Locked::kNo);
std::string tar(const std::vector<Member>& members);

}  // namespace isomesh::volume::test
