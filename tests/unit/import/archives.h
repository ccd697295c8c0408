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

// How a ZIP says that names are UTF-8: by flag 11 of a member, or by Info-ZIP's extra field 0x7075
// beside a name in ASCII.
enum class Utf8Names { kFlag, kField };

// A ZIP whose members are stored, under names in UTF-8.
std::string zip_in_utf8(const std::vector<Member>& members, Utf8Names names);

// A TAR whose member `name` is a file with an empty name, under a checksum that is right.
std::string without_name(std::string tar, std::string_view name);

}  // namespace isomesh::import::test
