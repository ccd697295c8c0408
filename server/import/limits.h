// How large an upload may become in memory and on the disk, beside --max-volume. Limits of single
// formats are in their readers.
#pragma once

#include <cstdint>

namespace isomesh::import::limits {

// Deflate compresses at most a thousandfold, and empty volumes come close to that. So archives that
// unpack to less than a gigabyte are never rejected as bombs.
inline constexpr std::uint64_t kMostArchivePerByte = 200;
inline constexpr std::uint64_t kNeverABomb = std::uint64_t{1} << 30;

// The longest header of lines that name a field and its value.
inline constexpr std::uint64_t kMostTextHeaderBytes = std::uint64_t{1} << 20;
inline constexpr std::uint64_t kMostTextHeaderLines = 100'000;

}  // namespace isomesh::import::limits
