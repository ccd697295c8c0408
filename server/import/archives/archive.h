// Unpacks ZIP and TAR.
#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <functional>
#include <map>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

namespace isomesh::import {

bool is_zip(std::string_view head);
bool is_tar(std::string_view head);

// How many bytes an archive of this size may unpack to, before it is taken for a bomb.
std::uint64_t most_unpacked_bytes(std::uint64_t archive_bytes);

struct ArchiveLimits {
  std::uint64_t max_bytes = 0;  // of all members, unpacked
  std::size_t max_members = 20000;
};

struct ArchiveMember {
  std::string name;  // as the archive has it, with its folders; never used as a path
  std::filesystem::path
      path;                 // where it was unpacked to: ends with its name as far as that is plain
  bool is_whole = true;     // otherwise only its first kBeginningBytes are there
  std::uint64_t bytes = 0;  // of all of it; 0 for one that is not whole and does not tell
};

// How many bytes a member of more than kBeginningBytes may have, of which the path holds so many;
// empty to leave it at those.
using MemberBound = std::function<std::optional<std::uint64_t>(const std::filesystem::path&)>;

// Unpacks the regular files of a ZIP or a plain TAR, large ones as far as `bound` says. Each gets a
// folder of its own below `folder`, which exists and is empty. Links, devices, empty and hidden
// files, and those in hidden folders are passed over. Throws Error kUnusableVolume when the archive
// is damaged, truncated or encrypted, when anything follows its end, when two members have one
// name, and when a member has more bytes than its bound or all tell more than most_unpacked_bytes;
// kTooLarge beyond the limits.
std::vector<ArchiveMember> unpack(const std::filesystem::path& archive,
                                  const std::filesystem::path& folder, const ArchiveLimits& limits,
                                  const MemberBound& bound);

// Unpacks members of that archive whole, to their paths: those whose paths `most` holds, up to so
// many bytes each. Throws as unpack does.
void unpack_whole(const std::filesystem::path& archive, const std::vector<ArchiveMember>& members,
                  const std::map<std::filesystem::path, std::uint64_t>& most,
                  const ArchiveLimits& limits);

// The part of a member's name before and with the last "/", and the part behind it.
std::string_view folder_of(std::string_view name);
std::string_view base_of(std::string_view name);

}  // namespace isomesh::import
