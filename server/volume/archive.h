// ZIP and TAR: their members, unpacked.
#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <string>
#include <string_view>
#include <vector>

namespace isomesh::volume {

bool is_zip(std::string_view head);
bool is_tar(std::string_view head);

// Beyond it an archive of this size is taken for a bomb.
std::uint64_t most_unpacked_bytes(std::uint64_t archive_bytes);

struct ArchiveLimits {
  std::uint64_t max_bytes = 0;  // of all members, unpacked
  std::size_t max_members = 20000;
};

struct ArchiveMember {
  std::string name;  // as the archive has it, with its folders; never used as a path
  std::filesystem::path
      path;  // where it was unpacked to: ends with its name as far as that is plain
};

// Unpacks the regular files of a ZIP or a plain TAR into folders below `folder`, which exists and
// is empty, each with a folder of its own. Links, devices and empty or hidden files are passed
// over. Throws Error kUnusableVolume when the archive is damaged, truncated or encrypted, when it
// has more behind its end or two members of one name, and for one that unpacks to so much more than
// it is that it can only be meant to do harm; kTooLarge beyond the limits.
std::vector<ArchiveMember> unpack(const std::filesystem::path& archive,
                                  const std::filesystem::path& folder, const ArchiveLimits& limits);

// The part of a member's name before and with the last "/", and the part behind it.
std::string_view folder_of(std::string_view name);
std::string_view base_of(std::string_view name);

}  // namespace isomesh::volume
