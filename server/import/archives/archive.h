// Unpacks ZIP and TAR.
#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
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
      path;  // where it was unpacked to: ends with its name as far as that is plain
};

// Unpacks the regular files of a ZIP or a plain TAR. Each gets a folder of its own below `folder`,
// which exists and is empty. Links, devices and empty or hidden files are passed over. Throws Error
// kUnusableVolume when the archive is damaged, truncated or encrypted, when anything follows its
// end, when two members have one name, and when it unpacks to more than most_unpacked_bytes;
// kTooLarge beyond the limits.
std::vector<ArchiveMember> unpack(const std::filesystem::path& archive,
                                  const std::filesystem::path& folder, const ArchiveLimits& limits);

// The part of a member's name before and with the last "/", and the part behind it.
std::string_view folder_of(std::string_view name);
std::string_view base_of(std::string_view name);

}  // namespace isomesh::import
