#include "server/import/samples/vtk_data.h"

#include <algorithm>
#include <array>
#include <numeric>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include <lz4.h>
#include <lzma.h>

#include "server/import/source/header_fields.h"

namespace isomesh::import {
namespace {

// Compressed blocks are decompressed in memory. VTK writes blocks of about 32 KiB.
constexpr std::uint64_t kLargestVtkBlock = std::uint64_t{64} << 20;

std::uint64_t expand_lz4(std::span<const std::byte> stored, std::span<std::byte> target) {
  const int found = ::LZ4_decompress_safe(
      reinterpret_cast<const char*>(stored.data()), reinterpret_cast<char*>(target.data()),
      static_cast<int>(stored.size()), static_cast<int>(target.size()));
  return found < 0 ? 0 : static_cast<std::uint64_t>(found);
}

std::uint64_t expand_xz(std::span<const std::byte> stored, std::span<std::byte> target) {
  std::uint64_t memory = std::uint64_t{256} << 20;  // the strongest setting needs 65 MiB
  std::size_t from = 0;
  std::size_t to = 0;
  const lzma_ret result = ::lzma_stream_buffer_decode(
      &memory, 0, nullptr, reinterpret_cast<const std::uint8_t*>(stored.data()), &from,
      stored.size(), reinterpret_cast<std::uint8_t*>(target.data()), &to, target.size());
  return result == LZMA_OK && from == stored.size() ? to : 0;
}

// A block of vtkLZ4DataCompressor (one LZ4 block) or vtkLZMADataCompressor (one .xz stream).
std::vector<std::byte> expanded_block(VtkCompression compression, std::span<const std::byte> stored,
                                      std::uint64_t bytes) {
  if (bytes > kLargestVtkBlock || stored.size() > 2 * kLargestVtkBlock) {
    throw_unusable("A compressed block of the VTK array is too large.");
  }
  std::vector<std::byte> block(bytes);
  const std::uint64_t found =
      compression == VtkCompression::kLz4 ? expand_lz4(stored, block) : expand_xz(stored, block);
  if (found != bytes) {
    throw_unusable("A compressed block of the VTK array is damaged or has the wrong size.");
  }
  return block;
}

[[noreturn]] void throw_short() {
  throw_unusable("The file is truncated: the VTK array of the samples ends too early.");
}

[[noreturn]] void throw_contradiction(std::uint64_t expected, std::uint64_t found) {
  throw_unusable("The VTK file contradicts itself: its extent needs " + std::to_string(expected) +
                 " bytes of samples, but its array declares " + std::to_string(found) + ".");
}

std::optional<unsigned> base64_digit(char letter) {
  if (letter >= 'A' && letter <= 'Z') return static_cast<unsigned>(letter - 'A');
  if (letter >= 'a' && letter <= 'z') return static_cast<unsigned>(letter - 'a') + 26;
  if (letter >= '0' && letter <= '9') return static_cast<unsigned>(letter - '0') + 52;
  if (letter == '+') return 62;
  if (letter == '/') return 63;
  return std::nullopt;
}

// Decodes a file's base64 text in order.
class Base64 {
 public:
  Base64(const InputFile& file, const CompressedRange& range)
      : file_(file), next_(range.offset), end_(range.offset + range.bytes) {}

  void read(std::span<std::byte> target) {
    for (std::byte& byte : target) {
      if (waiting_ == 0) decode_group();
      if (waiting_ == 0) throw_short();
      byte = group_[used_++];
      --waiting_;
    }
  }

  // The header and each block are encoded separately, so incomplete groups of digits between them
  // are dropped.
  void end_part() { waiting_ = 0; }

 private:
  void decode_group() {
    std::array<unsigned, 4> digits = {};
    std::size_t padding = 0;
    for (std::size_t at = 0; at < digits.size(); ++at) {
      const char letter = next_letter();
      const auto digit = base64_digit(letter);
      if (letter == '=' && at >= 2) {
        ++padding;
      } else if (digit && padding == 0) {
        digits[at] = *digit;
      } else {
        throw_unusable("The VTK array of the samples is not base64.");
      }
    }
    const unsigned bits = digits[0] << 18 | digits[1] << 12 | digits[2] << 6 | digits[3];
    group_ = {static_cast<std::byte>(bits >> 16 & 0xff), static_cast<std::byte>(bits >> 8 & 0xff),
              static_cast<std::byte>(bits & 0xff)};
    waiting_ = group_.size() - padding;
    used_ = 0;
  }

  char next_letter() {
    for (;;) {
      if (at_ == piece_.size()) refill();
      const char letter = piece_[at_++];
      if (!is_space(letter)) return letter;
    }
  }

  void refill() {
    piece_ = file_.text(next_, std::min<std::uint64_t>(kPieceBytes, end_ - next_));
    if (piece_.empty()) throw_short();
    next_ += piece_.size();
    at_ = 0;
  }

  const InputFile& file_;
  std::uint64_t next_;
  std::uint64_t end_;
  std::string piece_;
  std::size_t at_ = 0;
  std::array<std::byte, 3> group_ = {};
  std::size_t used_ = 0;
  std::size_t waiting_ = 0;
};

std::size_t count_bytes(const VtkEncoding& encoding) { return encoding.wide_header ? 8 : 4; }

std::uint64_t count_at(std::span<const std::byte> header, std::size_t index,
                       const VtkEncoding& encoding) {
  const HeaderBytes counts({reinterpret_cast<const char*>(header.data()), header.size()},
                           encoding.big_endian);
  return encoding.wide_header ? counts.at<std::uint64_t>(index * 8)
                              : counts.at<std::uint32_t>(index * 4);
}

struct Blocks {
  std::uint64_t bytes = 0;  // of each block except the last, decoded
  std::uint64_t last_bytes = 0;
  std::vector<std::uint64_t> stored;  // each block's compressed size in bytes
};

constexpr std::size_t kCountsAheadOfSizes = 3;

// The number of blocks. Throws if the header's three counts are inconsistent.
std::size_t block_count(std::span<const std::byte> counts, std::uint64_t expected,
                        const VtkEncoding& encoding) {
  // VTK's blocks have at least 32 KiB. Smaller ones are accepted while their sizes fit into memory.
  constexpr std::uint64_t kMostBlocks = std::uint64_t{1} << 24;
  constexpr std::uint64_t kLargestBlock = std::uint64_t{1} << 40;
  const std::uint64_t count = count_at(counts, 0, encoding);
  const std::uint64_t bytes = count_at(counts, 1, encoding);
  const std::uint64_t last = count_at(counts, 2, encoding);
  if (count == 0 || count > kMostBlocks || bytes == 0 || bytes > kLargestBlock || last > bytes) {
    throw_unusable("The VTK array's counts of compressed blocks are not plausible.");
  }
  if (count - 1 > expected / bytes) {
    throw_unusable(
        "The VTK file contradicts itself: its array declares more samples than its extent has.");
  }
  const std::uint64_t total = (count - 1) * bytes + (last == 0 ? bytes : last);
  if (total != expected) throw_contradiction(expected, total);
  return static_cast<std::size_t>(count);
}

Blocks blocks_of(std::span<const std::byte> counts, const VtkEncoding& encoding) {
  Blocks blocks;
  blocks.bytes = count_at(counts, 1, encoding);
  blocks.last_bytes = count_at(counts, 2, encoding);
  if (blocks.last_bytes == 0) blocks.last_bytes = blocks.bytes;
  const std::size_t all = counts.size() / count_bytes(encoding);
  for (std::size_t at = kCountsAheadOfSizes; at < all; ++at) {
    blocks.stored.push_back(count_at(counts, at, encoding));
    // Incompressible bytes grow slightly. The bound also prevents overflow of the sum.
    if (blocks.stored.back() > blocks.bytes + blocks.bytes / 2 + kPieceBytes) {
      throw_unusable("A compressed block of the VTK array is too large.");
    }
  }
  return blocks;
}

// A file's bytes, plain or decoded from base64.
class Source {
 public:
  Source(const InputFile& file, const CompressedRange& range, bool base64)
      : file_(file), next_(range.offset), end_(range.offset + range.bytes) {
    if (base64) base64_.emplace(file, range);
  }

  void read(std::span<std::byte> target) {
    if (base64_) return base64_->read(target);
    if (target.size() > end_ - next_ || file_.read(next_, target) != target.size()) throw_short();
    next_ += target.size();
  }

  const InputFile& file() const { return file_; }
  std::uint64_t next() const { return next_; }  // file offset of the next byte, if not base64

  void end_part() {
    if (base64_) base64_->end_part();
  }

  void copy(std::uint64_t bytes, ScratchFile& target) {
    std::vector<std::byte> piece(kPieceBytes);
    while (bytes > 0) {
      const auto part = std::span(piece).first(std::min<std::uint64_t>(piece.size(), bytes));
      read(part);
      target.write(part);
      bytes -= part.size();
    }
  }

 private:
  const InputFile& file_;
  std::uint64_t next_;
  std::uint64_t end_;
  std::optional<Base64> base64_;
};

std::vector<std::byte> read_block(const InputFile& file, std::uint64_t offset,
                                  std::uint64_t bytes) {
  if (bytes > 2 * kLargestVtkBlock) {
    throw_unusable("A compressed block of the VTK array is too large.");
  }
  std::vector<std::byte> block(bytes);
  if (file.read(offset, block) != block.size()) throw_short();
  return block;
}

void expand_blocks(const InputFile& file, std::uint64_t offset, const Blocks& blocks,
                   VtkCompression compression, ScratchFile& target) {
  const auto sink = [&](std::span<const std::byte> piece) { target.write(piece); };
  for (std::size_t at = 0; at < blocks.stored.size(); ++at) {
    const bool is_last = at + 1 == blocks.stored.size();
    const std::uint64_t bytes = is_last ? blocks.last_bytes : blocks.bytes;
    const std::uint64_t stored = blocks.stored[at];
    if (stored > file.size() - std::min(offset, file.size())) throw_short();
    if (compression != VtkCompression::kZlib) {
      target.write(expanded_block(compression, read_block(file, offset, stored), bytes));
    } else if (inflate_range(file, {offset, stored}, bytes, sink) != bytes) {
      throw_unusable("A compressed block of the VTK array has the wrong size.");
    }
    offset += stored;
  }
}

void decode_blocks(Source& source, std::uint64_t expected, const VtkEncoding& encoding,
                   const std::filesystem::path& scratch, ScratchFile& target) {
  const std::size_t size = count_bytes(encoding);
  std::vector<std::byte> counts(kCountsAheadOfSizes * size);
  source.read(counts);
  std::vector<std::byte> sizes(block_count(counts, expected, encoding) * size);
  source.read(sizes);
  source.end_part();
  counts.insert(counts.end(), sizes.begin(), sizes.end());
  const Blocks blocks = blocks_of(counts, encoding);
  if (!encoding.base64) {
    return expand_blocks(source.file(), source.next(), blocks, encoding.compression, target);
  }
  ScratchFile stored(scratch, ".blocks");
  source.copy(std::accumulate(blocks.stored.begin(), blocks.stored.end(), std::uint64_t{0}),
              stored);
  expand_blocks(InputFile(stored.path()), 0, blocks, encoding.compression, target);
}

}  // namespace

void decode_vtk(const InputFile& file, const CompressedRange& range, std::uint64_t bytes,
                const VtkEncoding& encoding, const std::filesystem::path& scratch,
                ScratchFile& target) {
  Source source(file, range, encoding.base64);
  if (encoding.compression != VtkCompression::kNone)
    return decode_blocks(source, bytes, encoding, scratch, target);
  std::vector<std::byte> header(count_bytes(encoding));
  source.read(header);
  const std::uint64_t found = count_at(header, 0, encoding);
  if (found != bytes) throw_contradiction(bytes, found);
  source.copy(bytes, target);
}

}  // namespace isomesh::import
