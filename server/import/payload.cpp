#include "server/import/payload.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <string>
#include <type_traits>
#include <vector>

#include "base/files.h"
#include "base/text.h"
#include "server/import/formats/vtk_data.h"

namespace isomesh::import {
namespace {

constexpr std::size_t kPieceBytes = std::size_t{1} << 18;

[[noreturn]] void throw_short(std::uint64_t expected, std::uint64_t found) {
  throw_unusable("The file is truncated: its header tells " + std::to_string(expected) +
                 " bytes of samples, and " + std::to_string(found) + " are there.");
}

// All samples, or the share of them that one data file holds.
struct Part {
  const InputFile& file;
  CompressedRange range;
  std::uint64_t bytes = 0;  // once decoded
  StoredType type = StoredType::kUint8;
};

[[noreturn]] void throw_long(std::uint64_t expected) {
  throw_unusable("The file holds more samples than its header tells, which are " +
                 std::to_string(expected) + " bytes.");
}

void inflate_part(const Part& part, ScratchFile& scratch) {
  const std::uint64_t found =
      inflate_range(part.file, part.range, part.bytes,
                    [&](std::span<const std::byte> piece) { scratch.write(piece); });
  if (found > part.bytes) throw_long(part.bytes);
  if (found < part.bytes) throw_short(part.bytes, found);
}

void copy_part(const Part& part, ScratchFile& scratch) {
  std::vector<std::byte> piece(kPieceBytes);
  for (std::uint64_t done = 0; done < part.bytes;) {
    const std::size_t wanted = std::min<std::uint64_t>(piece.size(), part.bytes - done);
    const std::size_t count =
        part.file.read(part.range.offset + done, std::span(piece).first(wanted));
    if (count == 0) throw_short(part.bytes, done);
    scratch.write(std::span(piece).first(count));
    done += count;
  }
}

// Collects decoded bytes, so that each system call writes many of them.
class Decoded {
 public:
  Decoded(std::uint64_t expected, ScratchFile& scratch) : scratch_(scratch), expected_(expected) {}

  void add(std::span<const std::byte> bytes) {
    if (bytes.size() > expected_ - count_) throw_long(expected_);
    count_ += bytes.size();
    pending_.insert(pending_.end(), bytes.begin(), bytes.end());
    if (pending_.size() >= kPieceBytes) flush();
  }

  void finish() {
    flush();
    if (count_ < expected_) throw_short(expected_, count_);
  }

 private:
  void flush() {
    scratch_.write(pending_);
    pending_.clear();
  }

  ScratchFile& scratch_;
  std::uint64_t expected_;
  std::uint64_t count_ = 0;
  std::vector<std::byte> pending_;
};

template <class Sample>
std::optional<Sample> parse_sample(std::string_view word) {
  if constexpr (std::is_floating_point_v<Sample>) {
    if (const auto value = parse_double(word)) return static_cast<Sample>(*value);
  } else if constexpr (std::is_unsigned_v<Sample>) {
    const auto value = parse_uint64(word);
    if (value && *value <= std::numeric_limits<Sample>::max()) return static_cast<Sample>(*value);
  } else {
    const auto value = parse_int64(word);
    if (value && *value >= std::numeric_limits<Sample>::min() &&
        *value <= std::numeric_limits<Sample>::max()) {
      return static_cast<Sample>(*value);
    }
  }
  return std::nullopt;
}

void decode_word(std::string_view word, StoredType type, Decoded& decoded) {
  // Some writers separate the numbers by commas as well.
  if (word.ends_with(',')) word.remove_suffix(1);
  with_stored_sample(type, [&](auto sample) {
    const auto value = parse_sample<decltype(sample)>(word);
    if (!value) throw_unusable("A sample is not a number of its type: " + in_quotes(word) + ".");
    sample = *value;
    decoded.add(std::as_bytes(std::span(&sample, 1)));
  });
}

void decode_text(const Part& part, ScratchFile& scratch) {
  constexpr std::size_t kLongestWord = 512;
  const InputFile& file = part.file;
  Decoded decoded(part.bytes, scratch);
  std::string rest;
  const std::uint64_t last = part.range.offset + part.range.bytes;
  for (std::uint64_t next = part.range.offset; next < last;) {
    std::string piece = rest + file.text(next, std::min<std::uint64_t>(kPieceBytes, last - next));
    next += piece.size() - rest.size();
    const std::size_t end = next < last ? piece.find_last_of(" \t\r\n") : piece.size();
    if (end == std::string::npos || piece.size() - end > kLongestWord) {
      throw_unusable("The samples are not numbers between white space.");
    }
    for (const std::string_view word : words(std::string_view(piece).substr(0, end))) {
      if (word != ",") decode_word(word, part.type, decoded);
    }
    rest = piece.substr(end);
  }
  decoded.finish();
}

std::optional<unsigned> hex_digit(char letter) {
  if (letter >= '0' && letter <= '9') return static_cast<unsigned>(letter - '0');
  if (letter >= 'a' && letter <= 'f') return static_cast<unsigned>(letter - 'a') + 10;
  if (letter >= 'A' && letter <= 'F') return static_cast<unsigned>(letter - 'A') + 10;
  return std::nullopt;
}

void decode_hex(const Part& part, ScratchFile& scratch) {
  Decoded decoded(part.bytes, scratch);
  unsigned value = 0;
  bool is_low_digit = false;
  for (std::uint64_t next = part.range.offset; next < part.file.size();) {
    const std::string piece = part.file.text(next, kPieceBytes);
    next += piece.size();
    for (const char letter : piece) {
      if (trimmed({&letter, 1}).empty()) continue;
      const auto digit = hex_digit(letter);
      if (!digit) throw_unusable("The samples are not hexadecimal digits.");
      value = (value * 16 + *digit) % 256;
      const auto byte = static_cast<std::byte>(value);
      if (is_low_digit) decoded.add({&byte, 1});
      is_low_digit = !is_low_digit;
    }
  }
  decoded.finish();
}

void decode_part(const SourceVolume& volume, const Part& part, const std::filesystem::path& folder,
                 ScratchFile& scratch) {
  switch (volume.encoding) {
    case Encoding::kRaw:
      return copy_part(part, scratch);
    case Encoding::kDeflate:
      return inflate_part(part, scratch);
    case Encoding::kText:
      return decode_text(part, scratch);
    case Encoding::kHex:
      return decode_hex(part, scratch);
    case Encoding::kVtk:
      return decode_vtk(part.file, part.range, part.bytes, volume.vtk, folder, scratch);
  }
}

// Less than a block or a slice may follow the samples, because some programs fill their last block
// up. A whole slice more than the header tells means that the header describes another volume.
void check_size(const InputFile& file, const SourceVolume& volume) {
  constexpr std::uint64_t kBlockBytes = 4096;
  const std::uint64_t expected = volume.stored_bytes();
  const std::uint64_t found = file.size() - std::min(volume.payload.offset, file.size());
  if (found < expected) throw_short(expected, found);
  const std::uint64_t slice = expected / volume.dims[2];
  if (found - expected > kBlockBytes && found - expected >= slice) throw_long(expected);
}

}  // namespace

Payload::Payload(const InputFile& file, const SourceVolume& volume,
                 const std::filesystem::path& scratch)
    : file_(file), layout_(volume.layout) {
  const bool is_raw = volume.encoding == Encoding::kRaw;
  if (is_raw && volume.data_files.empty()) {
    check_size(file, volume);
    offset_ = volume.payload.offset;
    return;
  }
  if (is_raw && volume.data_files.size() == 1) {
    decoded_.emplace(volume.data_files[0].path);
    offset_ = volume.data_files[0].range.offset;
    return;
  }
  scratch_.emplace(scratch, ".samples");
  if (volume.encoding == Encoding::kText) layout_.big_endian = false;
  if (volume.data_files.empty()) {
    decode_part(volume, {file, volume.payload, volume.stored_bytes(), volume.layout.type}, scratch,
                *scratch_);
  }
  for (const DataFile& data : volume.data_files) {
    const InputFile part(data.path);
    const std::uint64_t share = volume.stored_bytes() / volume.data_files.size();
    decode_part(volume, {part, data.range, share, volume.layout.type}, scratch, *scratch_);
  }
  decoded_.emplace(scratch_->path());
}

}  // namespace isomesh::import
