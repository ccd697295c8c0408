#include "server/import/samples/payload.h"

#include <algorithm>
#include <array>
#include <charconv>
#include <cmath>
#include <cstring>
#include <functional>
#include <limits>
#include <span>
#include <string>
#include <system_error>
#include <type_traits>
#include <vector>

#include "base/files.h"
#include "base/text.h"
#include "server/import/samples/vtk_data.h"
#include "server/import/source/gzip.h"

namespace isomesh::import {
namespace {

[[noreturn]] void throw_short(std::uint64_t expected, std::uint64_t found) {
  throw_unusable("The file is truncated: its header declares " + std::to_string(expected) +
                 " bytes of samples, but the file has " + std::to_string(found) + ".");
}

// All samples, or the part in one data file.
struct Part {
  const InputFile& file;
  CompressedRange range;
  std::uint64_t bytes = 0;  // once decoded
  Skip skip = 0;            // decoded bytes
  StoredType type = StoredType::kUint8;
};

[[noreturn]] void throw_long(std::uint64_t expected) {
  throw_unusable("The file has more than the " + std::to_string(expected) +
                 " bytes of samples that its header declares.");
}

// As inflate_range, for any kind of stream.
using StreamDecoder = std::function<std::uint64_t(const InputFile&, const CompressedRange&,
                                                  std::uint64_t limit, const ByteSink&)>;

// The largest size of a header within encoded data.
constexpr std::uint64_t kMostSkipped = std::uint64_t{1} << 20;

// Writes the decoded bytes, including those to skip.
void decode_stream(const Part& part, ScratchFile& scratch, const StreamDecoder& decode) {
  const std::uint64_t known = part.skip.value_or(0);
  const std::uint64_t most = part.bytes + (part.skip ? known : kMostSkipped);
  const std::uint64_t found = decode(
      part.file, part.range, most, [&](std::span<const std::byte> piece) { scratch.write(piece); });
  if (found > most) throw_long(part.bytes);
  const std::uint64_t needed = part.bytes + known;
  if (found < needed) throw_short(part.bytes, found - std::min(found, known));
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

// Buffers decoded bytes, to save system calls.
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
  // Some writers also separate numbers by commas.
  if (word.ends_with(',')) word.remove_suffix(1);
  with_stored_sample(type, [&](auto sample) {
    const auto value = parse_sample<decltype(sample)>(word);
    if (!value)
      throw_unusable("The sample " + in_quotes(word) +
                     " is not a number of the type that the header declares.");
    sample = *value;
    decoded.add(std::as_bytes(std::span(&sample, 1)));
  });
}

// VTK writes colours in text as fractions and rounds them to bytes when it reads them.
void decode_fraction(std::string_view word, StoredType /*type*/, Decoded& decoded) {
  constexpr double kMost = 255;
  const auto fraction = parse_double(word);
  const double value = std::round(fraction.value_or(-1) * kMost);
  if (!(value >= 0 && value <= kMost)) {
    throw_unusable("The sample " + in_quotes(word) +
                   " is not a number from 0 to 1, as COLOR_SCALARS are written in text.");
  }
  const auto byte = static_cast<std::byte>(value);
  decoded.add({&byte, 1});
}

void decode_text(const Part& part, ScratchFile& scratch,
                 void (*decode)(std::string_view, StoredType, Decoded&)) {
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
      throw_unusable("The samples are not numbers separated by white space.");
    }
    for (const std::string_view word : words(std::string_view(piece).substr(0, end))) {
      if (word != ",") decode(word, part.type, decoded);
    }
    rest = piece.substr(end);
  }
  decoded.finish();
}

void decode_half(const Part& part, bool big_endian, ScratchFile& scratch) {
  std::vector<std::uint16_t> halves(kPieceBytes);
  std::vector<float> floats;
  const std::uint64_t stored = part.bytes / 2;
  for (std::uint64_t done = 0; done < stored;) {
    const std::size_t count =
        std::min<std::uint64_t>(halves.size(), (stored - done) / sizeof(std::uint16_t));
    const std::span<std::byte> bytes = std::as_writable_bytes(std::span(halves).first(count));
    const std::size_t found = part.file.read(part.range.offset + done, bytes);
    if (found < bytes.size()) throw_short(stored, done + found);
    if (big_endian) swap_bytes(bytes, sizeof(std::uint16_t));
    floats.resize(count);
    floats_of_halves(std::span(halves).first(count), floats);
    scratch.write(std::as_bytes(std::span(floats)));
    done += found;
  }
}

void decode_bits(const Part& part, ScratchFile& scratch) {
  std::vector<std::byte> packed(kPieceBytes);
  std::vector<std::byte> samples;
  const std::uint64_t stored = part.bytes / 8 + (part.bytes % 8 > 0 ? 1 : 0);
  for (std::uint64_t done = 0; done < stored; done += packed.size()) {
    packed.resize(std::min<std::uint64_t>(packed.size(), stored - done));
    const std::size_t found = part.file.read(part.range.offset + done, packed);
    if (found < packed.size()) throw_short(stored, done + found);
    samples.clear();
    for (const std::byte byte : packed) {
      for (int bit = 7; bit >= 0; --bit) samples.push_back(byte >> bit & std::byte{1});
    }
    samples.resize(std::min<std::uint64_t>(samples.size(), part.bytes - done * 8));
    scratch.write(samples);
  }
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
      unsigned digit = 0;
      if (std::from_chars(&letter, &letter + 1, digit, 16).ec != std::errc{}) {
        throw_unusable("The samples are not hexadecimal digits.");
      }
      value = (value * 16 + digit) % 256;
      const auto byte = static_cast<std::byte>(value);
      if (is_low_digit) decoded.add({&byte, 1});
      is_low_digit = !is_low_digit;
    }
  }
  decoded.finish();
}

void convert_part(const Part& part, const SampleLayout& layout, ScratchFile& scratch) {
  const std::size_t size = bytes_per_sample(part.type);
  std::vector<std::byte> piece(kPieceBytes);
  for (std::uint64_t done = 0; done < part.bytes;) {
    const std::span<std::byte> samples =
        std::span(piece).first(std::min<std::uint64_t>(piece.size(), part.bytes - done));
    const std::uint64_t place = done / size * bytes_per_sample(layout.type);
    read_samples(part.file, part.range.offset + place, layout, samples);
    scratch.write(samples);
    done += samples.size();
  }
}

void decode_part(const SourceVolume& volume, const Part& part, const std::filesystem::path& folder,
                 ScratchFile& scratch) {
  switch (volume.encoding) {
    case Encoding::kRaw:
      return copy_part(part, scratch);
    case Encoding::kDeflate:
      return decode_stream(part, scratch,
                           [](const auto&... arguments) { return inflate_range(arguments...); });
    case Encoding::kBzip2:
      return decode_stream(part, scratch, unzip2_range);
    case Encoding::kText:
      return decode_text(part, scratch, decode_word);
    case Encoding::kFractionText:
      return decode_text(part, scratch, decode_fraction);
    case Encoding::kHex:
      return decode_hex(part, scratch);
    case Encoding::kHalf:
      return decode_half(part, volume.layout.big_endian, scratch);
    case Encoding::kBits:
      return decode_bits(part, scratch);
    case Encoding::kVtk:
      return decode_vtk(part.file, part.range, part.bytes, volume.vtk, folder, scratch);
  }
}

std::uint64_t trailing_bytes(const InputFile& file, const SourceVolume& volume,
                             std::uint64_t expected) {
  const std::uint64_t found = file.size() - std::min(volume.payload.offset, file.size());
  if (found < expected) throw_short(expected, found);
  if (volume.has_footer) return 0;
  if (!may_trail(found - expected, volume)) throw_long(expected);
  return found - expected;
}

}  // namespace

Payload::Payload(const InputFile& file, const SourceVolume& volume,
                 const std::filesystem::path& scratch)
    : file_(file), layout_(volume.layout) {
  const bool is_raw = volume.encoding == Encoding::kRaw;
  const auto packed = volume.packed_bytes(volume.stored_bytes());
  if (packed && volume.data_files.empty()) {
    const std::uint64_t bytes = trailing_bytes(file, volume, *packed);
    if (bytes > 0) notes_.push_back(trailing_note(bytes));
  }
  if (is_raw && volume.data_files.empty()) {
    offset_ = volume.payload.offset;
  } else if (is_raw && volume.data_files.size() == 1) {
    decoded_.emplace(volume.data_files[0].path);
    offset_ = volume.data_files[0].range.offset;
  } else {
    decode(volume, scratch);
  }
  if (volume.chosen.run != 0) {
    pick(volume, scratch);
  } else {
    offset_ += volume.chosen.index * volume.volume_bytes();
  }
}

void Payload::decode(const SourceVolume& volume, const std::filesystem::path& scratch) {
  scratch_.emplace(scratch, ".samples");
  const StoredType type = layout_.type;
  if (volume.encoding == Encoding::kText || volume.encoding == Encoding::kHalf) {
    layout_.big_endian = false;
  }
  if (volume.data_files.empty()) {
    decode_part(volume, {file_, volume.payload, volume.stored_bytes(), volume.decoded_skip, type},
                scratch, *scratch_);
  }
  for (const DataFile& data : volume.data_files) {
    const InputFile part(data.path);
    const std::uint64_t share = volume.stored_bytes() / volume.data_files.size();
    const Part samples = {part, data.range, share, volume.decoded_skip, type};
    if (data.layout) {
      convert_part(samples, *data.layout, *scratch_);
    } else {
      decode_part(volume, samples, scratch, *scratch_);
    }
  }
  decoded_.emplace(scratch_->path());
  offset_ = volume.decoded_skip.value_or(decoded_->size() - volume.stored_bytes());
}

// Copies the samples of one volume, which takes turns with others sample by sample, into a file of
// their own.
void Payload::pick_interleaved(const SourceVolume& volume, ScratchFile& target) {
  const std::size_t size = bytes_per_sample(layout_.type);
  const std::size_t step = size * volume.chosen.count;
  const std::size_t at_once = std::max<std::size_t>(kPieceBytes / step, 1);
  std::vector<std::byte> piece(at_once * step);
  std::vector<std::byte> samples;
  for (std::uint64_t left = volume.sample_count(); left > 0;) {
    const std::size_t count = std::min<std::uint64_t>(left, at_once);
    const std::span<std::byte> whole = std::span(piece).first(count * step);
    if (file().read(offset_, whole) != whole.size()) throw_short(volume.stored_bytes(), 0);
    samples.clear();
    for (std::size_t at = volume.chosen.index * size; at < whole.size(); at += step) {
      samples.insert(samples.end(), whole.begin() + static_cast<std::ptrdiff_t>(at),
                     whole.begin() + static_cast<std::ptrdiff_t>(at + size));
    }
    target.write(samples);
    offset_ += whole.size();
    left -= count;
  }
}

// The same for volumes that take turns with rows or planes.
void Payload::pick_runs(const SourceVolume& volume, ScratchFile& target) {
  const std::uint64_t run = volume.chosen.run * bytes_per_sample(layout_.type);
  const std::uint64_t runs = volume.sample_count() / volume.chosen.run;
  for (std::uint64_t at = 0; at < runs; ++at) {
    const std::uint64_t place = (at * volume.chosen.count + volume.chosen.index) * run;
    copy_part({file(), {offset_ + place, run}, run}, target);
  }
}

void Payload::pick(const SourceVolume& volume, const std::filesystem::path& scratch) {
  ScratchFile& target = picked_.emplace(scratch, ".volume");
  if (volume.chosen.run == 1) {
    pick_interleaved(volume, target);
  } else {
    pick_runs(volume, target);
  }
  decoded_.emplace(target.path());
  offset_ = 0;
}

}  // namespace isomesh::import
