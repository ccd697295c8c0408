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

// Call before the process drops the right to open files: otherwise names in a ZIP that are not
// ASCII are lost.
void load_name_encoding();

bool is_zip(std::string_view head);
bool is_tar(std::string_view head);
// True for a whole file that consists of the zeros which end a TAR.
bool is_empty_tar(std::string_view file);

// Throws Error kUnusableVolume.
[[noreturn]] void throw_empty_archive();

// The largest unpacked size of an archive of this size; larger ones are rejected as bombs.
std::uint64_t most_unpacked_bytes(std::uint64_t archive_bytes);

struct ArchiveLimits {
  std::uint64_t max_bytes = 0;  // of all members, unpacked
  std::size_t max_members = 20000;
};

struct ArchiveMember {
  std::string name;            // in UTF-8, with folders; never used as a path
  std::filesystem::path path;  // of the unpacked file; its file name is the member's, sanitised
  bool is_whole = true;        // otherwise truncated to kBeginningBytes
  std::uint64_t bytes = 0;     // of the whole member; 0 if truncated and unknown
};

// Returns the largest acceptable size of a member of more than kBeginningBytes, whose beginning is
// at the path; empty to unpack only the beginning.
using MemberBound = std::function<std::optional<std::uint64_t>(const std::filesystem::path&)>;

// Unpacks the regular files of a ZIP or a plain TAR, large ones as far as `bound` permits. Each
// gets its own folder below `folder`, which must exist and be empty. Skips links, devices, empty
// files, hidden files except a Zarr's, and files in hidden folders. Throws Error kUnusableVolume if
// the archive is damaged, truncated or encrypted, if it has no such file, if bytes follow its end,
// if two members have one name, if a member exceeds its bound, or if all together exceed
// most_unpacked_bytes; kTooLarge beyond the limits.
std::vector<ArchiveMember> unpack(const std::filesystem::path& archive,
                                  const std::filesystem::path& folder, const ArchiveLimits& limits,
                                  const MemberBound& bound);

// Unpacks members of the archive completely, to their paths: those in `most`, up to the given
// number of bytes. Throws as unpack does.
void unpack_whole(const std::filesystem::path& archive, const std::vector<ArchiveMember>& members,
                  const std::map<std::filesystem::path, std::uint64_t>& most,
                  const ArchiveLimits& limits);

// The part of a member's name up to and including the last "/", and the part after it.
std::string_view folder_of(std::string_view name);
std::string_view base_of(std::string_view name);

}  // namespace isomesh::import
