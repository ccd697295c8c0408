#include "server/volume/payload.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <string>
#include <type_traits>
#include <vector>

#include "server/volume/text.h"

namespace isomesh::volume {
namespace {

constexpr std::size_t kPieceBytes = std::size_t{1} << 18;

[[noreturn]] void throw_short(std::uint64_t expected, std::uint64_t found) {
  throw_unusable("The file is truncated: its header tells " + std::to_string(expected) +
                 " bytes of samples, and " + std::to_string(found) + " are there.");
}

[[noreturn]] void throw_long(std::uint64_t expected) {
  throw_unusable("The file holds more samples than its header tells, which are " +
                 std::to_string(expected) + " bytes.");
}

void inflate_payload(const InputFile& file, const SourceVolume& volume, ScratchFile& scratch) {
  const std::uint64_t expected = volume.stored_bytes();
  const std::uint64_t found =
      inflate_range(file, volume.payload, expected,
                    [&](std::span<const std::byte> piece) { scratch.write(piece); });
  if (found > expected) throw_long(expected);
  if (found < expected) throw_short(expected, found);
}

// Gathers decoded bytes into pieces worth a system call.
class Decoded {
 public:
  Decoded(const SourceVolume& volume, ScratchFile& scratch)
      : scratch_(scratch), expected_(volume.stored_bytes()) {}

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
  with_sample(type, [&](auto sample) {
    const auto value = parse_sample<decltype(sample)>(word);
    if (!value) throw_unusable("A sample is not a number of its type: " + in_quotes(word) + ".");
    sample = *value;
    decoded.add(std::as_bytes(std::span(&sample, 1)));
  });
}

void decode_text(const InputFile& file, const SourceVolume& volume, ScratchFile& scratch) {
  constexpr std::size_t kLongestWord = 512;
  Decoded decoded(volume, scratch);
  std::string rest;
  for (std::uint64_t next = volume.payload.offset; next < file.size();) {
    std::string piece = rest + file.text(next, kPieceBytes);
    next += piece.size() - rest.size();
    const std::size_t end = next < file.size() ? piece.find_last_of(" \t\r\n") : piece.size();
    if (end == std::string::npos || piece.size() - end > kLongestWord) {
      throw_unusable("The samples are not numbers between white space.");
    }
    for (const std::string_view word : words(std::string_view(piece).substr(0, end))) {
      if (word != ",") decode_word(word, volume.layout.type, decoded);
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

void decode_hex(const InputFile& file, const SourceVolume& volume, ScratchFile& scratch) {
  Decoded decoded(volume, scratch);
  unsigned value = 0;
  bool is_low_digit = false;
  for (std::uint64_t next = volume.payload.offset; next < file.size();) {
    const std::string piece = file.text(next, kPieceBytes);
    next += piece.size();
    for (const char letter : piece) {
      if (trim({&letter, 1}).empty()) continue;
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

}  // namespace

Payload::Payload(const InputFile& file, const SourceVolume& volume,
                 const std::filesystem::path& scratch)
    : file_(file), layout_(volume.layout) {
  if (volume.encoding == Encoding::kRaw) {
    const std::uint64_t expected = volume.stored_bytes();
    offset_ = volume.payload.offset;
    const std::uint64_t found = file.size() - std::min(offset_, file.size());
    if (found < expected) throw_short(expected, found);
    return;
  }
  scratch_.emplace(scratch, ".samples");
  switch (volume.encoding) {
    case Encoding::kRaw:
      break;
    case Encoding::kDeflate:
      inflate_payload(file, volume, *scratch_);
      break;
    case Encoding::kText:
      layout_.big_endian = false;
      decode_text(file, volume, *scratch_);
      break;
    case Encoding::kHex:
      decode_hex(file, volume, *scratch_);
      break;
  }
  decoded_.emplace(scratch_->path());
}

}  // namespace isomesh::volume
