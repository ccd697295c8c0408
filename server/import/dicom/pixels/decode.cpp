#include "server/import/dicom/pixels/decode.h"

#include <algorithm>
#include <array>
#include <cstring>
#include <mutex>
#include <optional>
#include <string>
#include <vector>

#include <gdcmDataElement.h>
#include <gdcmFragment.h>
#include <gdcmJPEG2000Codec.h>
#include <gdcmJPEGCodec.h>
#include <gdcmJPEGLSCodec.h>
#include <gdcmSequenceOfFragments.h>
#include <gdcmTrace.h>

#include "base/text.h"
#include "server/import/dicom/elements/tags.h"
#include "server/import/dicom/pixels/jpeg_xl.h"
#include "server/import/source/gzip.h"
#include "server/import/source/source.h"

namespace isomesh::import::dicom {
namespace {

enum class Family { kPlain, kRle, kDeflate, kJpeg, kJpegLs, kJpeg2000, kJpegXl };

struct Syntax {
  std::string_view uid;
  Family family;
  std::string_view name;
};

constexpr std::array kSyntaxes = {
    Syntax{kRle, Family::kRle, "RLE"}, Syntax{kDeflatedFrames, Family::kDeflate, "deflate"},
    Syntax{kEncapsulatedUncompressed, Family::kPlain, "uncompressed"},
    Syntax{"1.2.840.10008.1.2.4.50", Family::kJpeg, "JPEG baseline"},
    Syntax{"1.2.840.10008.1.2.4.51", Family::kJpeg, "JPEG extended"},
    Syntax{"1.2.840.10008.1.2.4.57", Family::kJpeg, "JPEG lossless"},
    Syntax{"1.2.840.10008.1.2.4.70", Family::kJpeg, "JPEG lossless"},
    Syntax{"1.2.840.10008.1.2.4.80", Family::kJpegLs, "JPEG-LS lossless"},
    Syntax{"1.2.840.10008.1.2.4.81", Family::kJpegLs, "JPEG-LS"},
    Syntax{"1.2.840.10008.1.2.4.90", Family::kJpeg2000, "JPEG 2000 lossless"},
    Syntax{"1.2.840.10008.1.2.4.91", Family::kJpeg2000, "JPEG 2000"},
    // OpenJPEG, which GDCM uses, decodes the block coder of either part of the standard.
    Syntax{"1.2.840.10008.1.2.4.201", Family::kJpeg2000, "HTJ2K lossless"},
    Syntax{"1.2.840.10008.1.2.4.202", Family::kJpeg2000, "HTJ2K lossless"},
    Syntax{"1.2.840.10008.1.2.4.203", Family::kJpeg2000, "HTJ2K"},
    Syntax{"1.2.840.10008.1.2.4.110", Family::kJpegXl, "JPEG XL lossless"},
    Syntax{"1.2.840.10008.1.2.4.111", Family::kJpegXl, "JPEG XL"},
    Syntax{"1.2.840.10008.1.2.4.112", Family::kJpegXl, "JPEG XL"}};

const Syntax* find_syntax(std::string_view uid) {
  const auto* found =
      std::ranges::find(kSyntaxes, uid, [](const Syntax& syntax) { return syntax.uid; });
  return found == kSyntaxes.end() ? nullptr : found;
}

std::uint32_t big_endian(std::span<const std::byte> bytes, std::size_t at, std::size_t count) {
  std::uint32_t number = 0;
  for (std::size_t i = 0; i < count; ++i) {
    number = number << 8 | std::to_integer<std::uint32_t>(bytes[at + i]);
  }
  return number;
}

// Frame headers have the markers C0 to CF, except C4, C8 and CC, which are tables or reserved, and
// F7 of JPEG-LS.
bool is_frame_header(std::uint32_t marker) {
  if (marker == 0xFFF7) return true;
  return marker >= 0xFFC0 && marker <= 0xFFCF && marker != 0xFFC4 && marker != 0xFFC8 &&
         marker != 0xFFCC;
}

std::optional<StreamSize> jpeg_size(std::span<const std::byte> stream) {
  if (stream.size() < 4 || big_endian(stream, 0, 2) != 0xFFD8) return std::nullopt;
  for (std::size_t at = 2; at + 10 <= stream.size();) {
    const std::uint32_t marker = big_endian(stream, at, 2);
    if (marker == 0xFFFF) {  // fill bytes may precede a marker
      ++at;
      continue;
    }
    if (marker < 0xFF01) return std::nullopt;
    if (is_frame_header(marker)) {
      return StreamSize{.columns = big_endian(stream, at + 7, 2),
                        .rows = big_endian(stream, at + 5, 2),
                        .components = big_endian(stream, at + 9, 1),
                        .bits = big_endian(stream, at + 4, 1)};
    }
    at += 2 + std::size_t{big_endian(stream, at + 2, 2)};
  }
  return std::nullopt;
}

// ISO/IEC 15444-1, A.5.1: the SIZ segment is the first one after the start of the code stream.
std::optional<StreamSize> jpeg_2000_size(std::span<const std::byte> stream) {
  constexpr std::size_t kNeeded = 43;
  if (stream.size() < kNeeded || big_endian(stream, 0, 4) != 0xFF4FFF51) return std::nullopt;
  const std::uint32_t right = big_endian(stream, 8, 4);
  const std::uint32_t bottom = big_endian(stream, 12, 4);
  const std::uint32_t left = big_endian(stream, 16, 4);
  const std::uint32_t top = big_endian(stream, 20, 4);
  if (right < left || bottom < top) return std::nullopt;
  return StreamSize{.columns = right - left,
                    .rows = bottom - top,
                    .components = big_endian(stream, 40, 2),
                    .bits = (big_endian(stream, 42, 1) & 0x7FU) + 1,
                    .is_signed = (big_endian(stream, 42, 1) & 0x80U) != 0};
}

// GDCM fills up a truncated stream without an error. So the stream must end with FFD9, followed
// only by padding.
bool is_whole(std::span<const std::byte> stream) {
  while (!stream.empty() && (stream.back() == std::byte{0} || stream.back() == std::byte{0xFF})) {
    stream = stream.first(stream.size() - 1);
  }
  return stream.size() >= 2 && big_endian(stream, stream.size() - 2, 2) == 0xFFD9;
}

std::optional<StreamSize> size_of(std::span<const std::byte> stream, Family family) {
  if (family == Family::kJpegXl) return jpeg_xl_size(stream);
  return family == Family::kJpeg2000 ? jpeg_2000_size(stream) : jpeg_size(stream);
}

// Returns the stream's size, in which samples of 16 bits may be only 8.
StreamSize check_stream(std::span<const std::byte> stream, const Syntax& syntax,
                        const PixelLayout& layout) {
  const auto size = size_of(stream, syntax.family);
  if (!size) {
    throw_unusable("its compressed samples are not a " + std::string(syntax.name) + " stream");
  }
  // libjxl finds the end itself.
  if (syntax.family != Family::kJpegXl && !is_whole(stream)) {
    throw_unusable("its compressed samples are truncated");
  }
  if (size->columns != layout.columns || size->rows != layout.rows || size->components != 1) {
    throw_unusable("its compressed samples are " + std::to_string(size->columns) + " x " +
                   std::to_string(size->rows) + " with " + std::to_string(size->components) +
                   " components, but its header declares " + std::to_string(layout.columns) +
                   " x " + std::to_string(layout.rows) + " with 1");
  }
  if (syntax.family == Family::kJpegXl && layout.samples() > kMostJpegXlSamples) {
    throw_unusable("its JPEG XL stream has " + std::to_string(layout.samples()) +
                   " samples, more than the " + std::to_string(kMostJpegXlSamples) +
                   " that can be decoded");
  }
  const unsigned bytes = (size->bits + 7) / 8;
  if (bytes > 2 && syntax.family != Family::kJpeg2000) {  // GDCM would end the process
    throw_unusable("its " + std::string(syntax.name) + " stream has " + std::to_string(size->bits) +
                   " bits, but it may have at most 16");
  }
  if (bytes != layout.bits_allocated / 8 && !(bytes == 1 && layout.bits_allocated == 16)) {
    throw_unusable("its compressed samples have " + std::to_string(size->bits) +
                   " bits, but its header declares " + std::to_string(layout.bits_allocated));
  }
  // With all bits that are stored, the header says how to understand them.
  if (size->is_signed && !layout.is_signed && size->bits < layout.bits_stored) {
    throw_unusable("its compressed samples are signed, with " + std::to_string(size->bits) +
                   " bits, but its header declares " + std::to_string(layout.bits_stored) +
                   " bits without a sign");
  }
  return *size;
}

// Returns the number of bytes that the segment has for the target, up to its size.
std::size_t decode_rle_bytes(std::span<const std::byte> segment, std::size_t first,
                             std::size_t stride, std::span<std::byte> target) {
  std::size_t at = first;
  std::size_t decoded = 0;
  for (std::size_t next = 0; at < target.size();) {
    if (next + 1 >= segment.size()) return decoded;
    const int control = static_cast<signed char>(segment[next++]);
    if (control == -128) continue;
    const bool is_run = control < 0;
    const auto count = static_cast<std::size_t>(is_run ? 1 - control : control + 1);
    if (!is_run && count > segment.size() - next) return decoded;
    for (std::size_t i = 0; i < count && at < target.size(); ++i, at += stride, ++decoded) {
      target[at] = segment[is_run ? next : next + i];
    }
    next += is_run ? 1 : count;
  }
  return decoded;
}

void decode_rle_segment(std::span<const std::byte> segment, std::size_t first, std::size_t stride,
                        std::span<std::byte> target) {
  if (decode_rle_bytes(segment, first, stride, target) < target.size() / stride) {
    throw_unusable("its RLE segment ends before its samples do");
  }
}

std::vector<std::span<const std::byte>> rle_segments(std::span<const std::byte> stream,
                                                     std::size_t segments) {
  constexpr std::size_t kHeaderBytes = 64;
  if (stream.size() < kHeaderBytes) throw_unusable("its RLE header is truncated");
  const auto header = [&](std::size_t index) {
    std::array<std::byte, 4> word;
    std::copy_n(stream.begin() + static_cast<std::ptrdiff_t>(index) * 4, 4, word.begin());
    std::reverse(word.begin(), word.end());
    return std::size_t{big_endian(word, 0, 4)};
  };
  if (header(0) != segments) {
    throw_unusable("its RLE header declares " + std::to_string(header(0)) + " segments, but " +
                   std::to_string(segments) + (segments == 1 ? " is needed" : " are needed"));
  }
  std::vector<std::span<const std::byte>> all;
  for (std::size_t i = 0; i < segments; ++i) {
    const std::size_t begin = header(i + 1);
    const std::size_t end = i + 1 < segments ? header(i + 2) : stream.size();
    if (begin < kHeaderBytes || begin > end || end > stream.size()) {
      throw_unusable("its RLE segments lie outside its compressed data");
    }
    all.push_back(stream.subspan(begin, end - begin));
  }
  return all;
}

// PS3.5, annex G: one segment of packed bytes per byte of a sample, highest first. Decoded here,
// because GDCM reports success for streams that end early.
void decode_rle(std::span<const std::byte> stream, const PixelLayout& layout,
                std::span<std::byte> target) {
  const std::size_t segments = layout.bits_allocated / 8;
  const std::vector<std::span<const std::byte>> all = rle_segments(stream, segments);
  for (std::size_t i = 0; i < segments; ++i) {
    decode_rle_segment(all[i], segments - 1 - i, segments, target);
  }
}

// A frame of an odd number of bytes is padded, so the stream may be longer.
void decode_deflate(std::span<const std::byte> stream, std::span<std::byte> target) {
  if (inflate_bytes(stream, target) < target.size()) {
    throw_unusable("its deflated samples end before its size does");
  }
}

// As for deflated frames.
void copy_plain(std::span<const std::byte> stream, std::span<std::byte> target) {
  if (stream.size() < target.size()) throw_unusable("its samples end before its size does");
  std::ranges::copy(stream.first(target.size()), target.begin());
}

// GDCM writes warnings about files to standard error.
void silence_gdcm() {
  static std::once_flag once;
  std::call_once(once, [] {
    gdcm::Trace::DebugOff();
    gdcm::Trace::WarningOff();
    gdcm::Trace::ErrorOff();
  });
}

template <class Codec>
bool decode_by(const gdcm::DataElement& input, const PixelLayout& layout,
               gdcm::DataElement& output) {
  Codec codec;
  const std::array<unsigned, 3> dimensions = {layout.columns, layout.rows, 1};
  const auto bits = [](unsigned count) { return static_cast<unsigned short>(count); };
  codec.SetNumberOfDimensions(2);
  codec.SetDimensions(dimensions.data());
  // GDCM ends the process if fewer bits are stored than allocated, except of 16. Unused bits are
  // removed later (values.cpp).
  const unsigned stored = layout.bits_allocated == 16 ? layout.bits_stored : layout.bits_allocated;
  codec.SetPixelFormat(gdcm::PixelFormat(1, bits(layout.bits_allocated), bits(stored),
                                         bits(stored - 1), layout.is_signed ? 1 : 0));
  codec.SetPhotometricInterpretation(gdcm::PhotometricInterpretation::MONOCHROME2);
  if constexpr (requires { codec.SetBufferLength(0); }) {
    codec.SetBufferLength(layout.frame_bytes());
  }
  return codec.Decode(input, output);
}

bool decode_by_gdcm(Family family, const gdcm::DataElement& input, const PixelLayout& layout,
                    gdcm::DataElement& output) {
  switch (family) {
    case Family::kPlain:
    case Family::kRle:
    case Family::kDeflate:
    case Family::kJpegXl:
      return false;
    case Family::kJpeg:
      return decode_by<gdcm::JPEGCodec>(input, layout, output);
    case Family::kJpegLs:
      return decode_by<gdcm::JPEGLSCodec>(input, layout, output);
    case Family::kJpeg2000:
      return decode_by<gdcm::JPEG2000Codec>(input, layout, output);
  }
  return false;
}

void decode_checked(std::span<const std::byte> stream, const Syntax& syntax,
                    const PixelLayout& layout, std::span<std::byte> target) {
  silence_gdcm();
  gdcm::Fragment fragment;
  fragment.SetByteValue(reinterpret_cast<const char*>(stream.data()),
                        static_cast<std::uint32_t>(stream.size()));
  const gdcm::SmartPointer<gdcm::SequenceOfFragments> fragments = new gdcm::SequenceOfFragments;
  fragments->AddFragment(fragment);
  gdcm::DataElement input(gdcm::Tag(0x7fe0, 0x0010));
  input.SetValue(*fragments);
  gdcm::DataElement output;
  bool decoded = false;
  try {
    decoded = decode_by_gdcm(syntax.family, input, layout, output);
  } catch (const std::exception&) {
    // GDCM's messages are not forwarded, because they name its source files.
  }
  const gdcm::ByteValue* bytes = decoded ? output.GetByteValue() : nullptr;
  if (bytes == nullptr || std::size_t{bytes->GetLength()} < target.size()) {
    throw_unusable("its " + std::string(syntax.name) + " stream is corrupt");
  }
  std::memcpy(target.data(), bytes->GetPointer(), target.size());
}

// From bytes in the first half to words, from the last, so that none is overwritten before it is
// read.
void widen(std::span<std::byte> target, bool is_signed) {
  for (std::size_t at = target.size() / 2; at-- > 0;) {
    const std::byte low = target[at];
    const bool is_negative = is_signed && (low & std::byte{0x80}) != std::byte{0};
    target[at * 2] = low;
    target[at * 2 + 1] = std::byte{is_negative ? std::uint8_t{0xFF} : std::uint8_t{0}};
  }
}

void decode_jpeg(std::span<const std::byte> stream, const Syntax& syntax, const PixelLayout& layout,
                 std::span<std::byte> target) {
  const StreamSize size = check_stream(stream, syntax, layout);
  if (syntax.family == Family::kJpegXl) {
    if (decode_jpeg_xl(stream, size, layout.bits_allocated / 8, target)) return;
    throw_unusable("its JPEG XL stream is truncated or corrupt");
  }
  if (size.bits > 8 || layout.bits_allocated == 8) {
    return decode_checked(stream, syntax, layout, target);
  }
  PixelLayout bytes = layout;
  bytes.bits_allocated = 8;
  bytes.is_signed = size.is_signed;
  decode_checked(stream, syntax, bytes, target.first(target.size() / 2));
  widen(target, size.is_signed);
}

// Spreads the bits at the beginning over all bytes, from the last, so that none is overwritten
// before it is read.
void unpack_bits(std::span<std::byte> bytes) {
  for (std::size_t at = bytes.size(); at-- > 0;) {
    bytes[at] = bytes[at / 8] >> (at % 8) & std::byte{1};
  }
}

}  // namespace

bool can_decode(std::string_view transfer_syntax) {
  return find_syntax(transfer_syntax) != nullptr;
}

void decode_frame(std::string_view transfer_syntax, std::span<const std::byte> compressed,
                  const PixelLayout& layout, std::span<std::byte> target) {
  const Syntax* syntax = find_syntax(transfer_syntax);
  if (syntax == nullptr) {
    throw_unusable("its transfer syntax " + in_quotes(transfer_syntax) + " is not supported");
  }
  if (syntax->family == Family::kRle) return decode_rle(compressed, layout, target);
  if (syntax->family == Family::kDeflate) return decode_deflate(compressed, target);
  if (syntax->family == Family::kPlain) return copy_plain(compressed, target);
  decode_jpeg(compressed, *syntax, layout, target);
}

void decode_bits(std::string_view transfer_syntax, std::span<const std::byte> compressed,
                 const PixelLayout& layout, std::span<std::byte> target) {
  const Syntax* syntax = find_syntax(transfer_syntax);
  const auto is_of = [&](Family family) { return syntax != nullptr && syntax->family == family; };
  std::size_t decoded = target.size();
  if (is_of(Family::kDeflate)) {
    decoded = inflate_bytes(compressed, target);
  } else if (is_of(Family::kPlain)) {
    decoded = std::min(compressed.size(), target.size());
    std::ranges::copy(compressed.first(decoded), target.begin());
  } else if (is_of(Family::kRle)) {
    decoded = decode_rle_bytes(rle_segments(compressed, 1).front(), 0, 1, target);
  } else {
    PixelLayout bytes = layout;
    bytes.bits_allocated = 8;
    decode_frame(transfer_syntax, compressed, bytes, target);
  }
  if (decoded < layout.frame_bytes()) {
    throw_unusable("its compressed samples end before its size does");
  }
  if (decoded < target.size()) unpack_bits(target);
  for (std::byte& sample : target) sample = std::byte{sample != std::byte{0}};
}

}  // namespace isomesh::import::dicom
