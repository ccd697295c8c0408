#include "server/import/dicom/pixels/pixels.h"

#include <algorithm>
#include <string>

#include "base/text.h"
#include "server/import/dicom/elements/tags.h"
#include "server/import/dicom/pixels/decode.h"
#include "server/import/dicom/pixels/values.h"
#include "server/import/source/source.h"

namespace isomesh::import::dicom {
namespace {

// Compression may enlarge samples slightly.
std::uint64_t most_compressed_bytes(const PixelLayout& layout) {
  return layout.frame_bytes() * 2 + (std::uint64_t{1} << 20);
}

void swap_pairs(std::span<std::byte> bytes) {
  for (std::size_t at = 0; at + 1 < bytes.size(); at += 2) std::swap(bytes[at], bytes[at + 1]);
}

// The start of a compressed frame in the supported syntaxes. The two bytes of a bare JPEG XL stream
// are too few to be looked for in others.
bool begins_frame(const DicomFile& file, const Extent& fragment) {
  constexpr std::string_view kJpegXls = "1.2.840.10008.1.2.4.11";
  const std::string head = file.bytes().text(fragment.offset, 8);
  if (file.transfer_syntax().starts_with(kJpegXls)) {
    return head.starts_with("\xFF\x0A") || head == std::string_view("\0\0\0\x0CJXL ", 8);
  }
  return head.starts_with("\xFF\xD8\xFF") || head.starts_with("\xFF\x4F\xFF\x51");
}

bool is_one_of(const std::vector<std::uint64_t>& sorted, std::uint64_t value) {
  return std::binary_search(sorted.begin(), sorted.end(), value);
}

std::vector<std::size_t> first_fragments(const DicomFile& file, std::size_t frames) {
  const PixelElement& pixels = *file.pixels();
  const std::size_t fragments = pixels.fragments.size();
  std::vector<std::size_t> firsts;
  // Some tables of offsets are wrong.
  for (const bool by_table : {pixels.frame_offsets.size() == frames, false}) {
    if (firsts.size() == frames) break;
    firsts.clear();
    std::uint64_t offset = 0;  // of a fragment's item, relative to the first one's
    for (std::size_t i = 0; i < fragments; ++i) {
      const bool is_first = fragments == frames || i == 0 ||
                            (frames > 1 && (by_table ? is_one_of(pixels.frame_offsets, offset)
                                                     : begins_frame(file, pixels.fragments[i])));
      if (is_first) firsts.push_back(i);
      offset += pixels.fragments[i].bytes + 8;
    }
  }
  if (firsts.size() != frames) {
    throw_unusable("its compressed frames cannot be separated: " + std::to_string(fragments) +
                   " fragments hold " + std::to_string(frames) + " frames");
  }
  firsts.push_back(fragments);
  return firsts;
}

// --- Layout --------------------------------------------------------------------------------------

// One frame is decoded in memory, so its size is bounded.
constexpr std::uint64_t kMostFrameBytes = std::uint64_t{1} << 29;

constexpr std::uint32_t kMostSamplesOfRow = 0xFFFF;

unsigned required(const DataSet& data, Tag tag, std::string_view name) {
  if (const auto number = data.unsigned_number(tag)) return *number;
  throw_unusable("The DICOM image does not declare its " + std::string(name) + ' ' + tag_name(tag) +
                 ".");
}

void refuse_colours(const DataSet& data) {
  const auto samples = data.unsigned_number(kSamplesPerPixel).value_or(1);
  const std::string_view photometric = data.text(kPhotometricInterpretation);
  // Grey samples have the same values with any interpretation.
  if (samples == 1 && (photometric.starts_with("MONOCHROME") || photometric.empty())) return;
  if (samples == 1 && photometric == "PALETTE COLOR") {
    // A segmentation's labels do not depend on its palette.
    if (!data.text(kSegmentationType).empty()) return;
    throw_unusable(
        "The DICOM image is in colour: its samples are indices into a palette. Only grey images "
        "are read.");
  }
  throw_unusable("The DICOM image is in colour: " + in_quotes(photometric) + " with " +
                 std::to_string(samples) + (samples == 1 ? " sample" : " samples") +
                 " per pixel. Only grey images are read.");
}

void check_bits(const PixelLayout& layout) {
  const unsigned allocated = layout.bits_allocated;
  if (allocated != 1 && allocated != 8 && allocated != 16 && allocated != 32) {
    throw_unusable("The DICOM image's samples have " + std::to_string(allocated) +
                   " bits. 1, 8, 16 and 32 bits are supported.");
  }
  if (layout.bits_stored == 0 || layout.bits_stored > allocated || layout.high_bit >= allocated ||
      layout.high_bit + 1 < layout.bits_stored) {
    throw_unusable("The DICOM image's header contradicts itself: it stores " +
                   std::to_string(layout.bits_stored) + " bits up to bit " +
                   std::to_string(layout.high_bit) + " of " + std::to_string(allocated) + ".");
  }
}

// Floating-point numbers have their own elements; the declared bits do not apply.
bool take_float(const DicomFile& file, PixelLayout& layout) {
  if (!file.pixels() || file.pixels()->tag == kPixelData) return false;
  layout.is_float = true;
  layout.is_signed = false;
  layout.bits_allocated = file.pixels()->tag == kFloatPixelData ? 32 : 64;
  layout.bits_stored = layout.bits_allocated;
  layout.high_bit = layout.bits_stored - 1;
  return true;
}

// An empty syntax is missing in the file.
bool is_native_syntax(std::string_view syntax) {
  return syntax.empty() || syntax == kImplicitLittleEndian || syntax == kExplicitLittleEndian ||
         syntax == kDeflated || syntax == kExplicitBigEndian;
}

void check_syntax(const DicomFile& file, const PixelLayout& layout) {
  const std::string& syntax = file.transfer_syntax();
  const bool is_encapsulated = file.pixels()->is_encapsulated;
  if (!(is_encapsulated ? can_decode(syntax) : is_native_syntax(syntax))) {
    throw_unusable(
        "The DICOM image's transfer syntax " + in_quotes(syntax) +
        (is_encapsulated ? " is not supported." : " is not one for uncompressed samples."));
  }
  if (is_encapsulated && layout.is_float) {
    throw_unusable(
        "The DICOM image's samples are compressed. Floating-point numbers are read only "
        "uncompressed.");
  }
}

}  // namespace

FrameReader::FrameReader(const DicomFile& file, const Image& image)
    : file_(file), image_(image), stored_(image.stored) {
  if (!file.pixels()->is_encapsulated) return;
  first_fragments_ = first_fragments(file, image.tiles_per_row > 0 ? 1 : image.frames.size());
}

void FrameReader::read(std::uint32_t frame, std::span<std::byte> target, const SeeStored& see) {
  if (image_.tiles_per_row == 0 && image_.table) return read_by_table(frame, target, see);
  if (image_.tiles_per_row > 0) {
    read_tile(frame, target);
  } else if (stored_.bits_allocated == 1) {
    read_bits(frame, target);
  } else {
    read_stored(frame, target);
  }
  if (see) see(target, image_.layout);
}

void FrameReader::read_by_table(std::uint32_t frame, std::span<std::byte> target,
                                const SeeStored& see) const {
  std::vector<std::byte> stored(stored_.frame_bytes());
  read_stored(frame, stored);
  if (see) see(stored, stored_);
  apply_table(*image_.table, stored_, stored, target);
}

void FrameReader::read_stored(std::uint32_t frame, std::span<std::byte> target) const {
  if (!file_.pixels()->is_encapsulated) return read_native(frame, target);
  decode_frame(file_.transfer_syntax(), compressed(frame), stored_, target);
}

void FrameReader::read_tile(std::uint32_t tile, std::span<std::byte> target) {
  if (mosaic_.empty()) {
    mosaic_.resize(stored_.frame_bytes());
    read_stored(0, mosaic_);
  }
  const PixelLayout& layout = image_.layout;
  const std::size_t sample = stored_.bits_allocated / 8;
  const std::size_t row_bytes = layout.columns * sample;
  const std::size_t left = tile % image_.tiles_per_row * row_bytes;
  const std::size_t top = std::size_t{tile / image_.tiles_per_row} * layout.rows;
  for (std::size_t row = 0; row < layout.rows; ++row) {
    const std::size_t from = (top + row) * stored_.columns * sample + left;
    std::ranges::copy(std::span(mosaic_).subspan(from, row_bytes),
                      target.subspan(row * row_bytes, row_bytes).begin());
  }
}

// Bits fill bytes from the lowest. Frames may start within a byte, but compressed ones never do.
void FrameReader::read_bits(std::uint32_t frame, std::span<std::byte> target) const {
  const PixelElement& pixels = *file_.pixels();
  if (pixels.is_encapsulated) {
    return decode_bits(file_.transfer_syntax(), compressed(frame), stored_, target);
  }
  const std::uint64_t first = std::uint64_t{frame} * target.size();
  const bool is_swapped = file_.transfer_syntax() == kExplicitBigEndian && pixels.is_words;
  // Whole words, because big-endian words have swapped bytes.
  const std::uint64_t begin = first / 16 * 2;
  const std::uint64_t end = std::min((first + target.size() + 15) / 16 * 2, pixels.native.bytes);
  std::vector<std::byte> packed(end - begin);
  if (file_.bytes().read(pixels.native.offset + begin, packed) != packed.size()) {
    throw_unusable("the file ends before its samples do");
  }
  if (is_swapped) {
    if (packed.size() % 2 != 0) throw_unusable("its bytes are swapped across its end");
    swap_pairs(packed);
  }
  for (std::size_t at = 0; at < target.size(); ++at) {
    const std::uint64_t bit = first + at - begin * 8;
    target[at] = packed[bit / 8] >> (bit % 8) & std::byte{1};
  }
}

void FrameReader::read_native(std::uint32_t frame, std::span<std::byte> target) const {
  const PixelElement& pixels = *file_.pixels();
  const std::uint64_t offset = pixels.native.offset + frame * stored_.frame_bytes();
  if (file_.bytes().read(offset, target) != target.size()) {
    throw_unusable("the file ends before its samples do");
  }
  if (file_.transfer_syntax() != kExplicitBigEndian) return;
  if (stored_.bits_allocated > 8) {
    swap_bytes(target, stored_.bits_allocated / 8);
  } else if (pixels.is_words) {
    if (target.size() % 2 != 0) throw_unusable("its bytes are swapped across its end");
    swap_pairs(target);
  }
}

std::vector<std::byte> FrameReader::compressed(std::uint32_t frame) const {
  const std::vector<Extent>& fragments = file_.pixels()->fragments;
  const std::size_t first = first_fragments_[frame];
  const std::size_t end = first_fragments_[frame + 1];
  std::uint64_t bytes = 0;
  for (std::size_t i = first; i < end; ++i) bytes += fragments[i].bytes;
  if (bytes > most_compressed_bytes(stored_)) {
    throw_unusable("its compressed samples take far more bytes than its size explains");
  }
  std::vector<std::byte> result(bytes);
  std::span<std::byte> rest = result;
  for (std::size_t i = first; i < end; ++i) {
    file_.bytes().read(fragments[i].offset, rest.first(fragments[i].bytes));
    rest = rest.subspan(fragments[i].bytes);
  }
  return result;
}

PixelLayout pixel_layout(const DicomFile& file) {
  const DataSet& data = file.data();
  refuse_colours(data);
  PixelLayout layout;
  layout.columns = required(data, kColumns, "columns");
  layout.rows = required(data, kRows, "rows");
  if (layout.columns == 0 || layout.rows == 0) throw_unusable("The DICOM image's size is 0.");
  if (std::max(layout.columns, layout.rows) > kMostSamplesOfRow) {
    throw_unusable("The DICOM image has more rows or columns than DICOM allows.");
  }
  if (take_float(file, layout)) return layout;
  layout.bits_allocated = required(data, kBitsAllocated, "bits allocated");
  layout.bits_stored = data.unsigned_number(kBitsStored).value_or(layout.bits_allocated);
  layout.high_bit = data.unsigned_number(kHighBit).value_or(layout.bits_stored - 1);
  layout.is_signed = data.unsigned_number(kPixelRepresentation).value_or(0) != 0;
  check_bits(layout);
  return layout;
}

void require_pixels(const DicomFile& file, const PixelLayout& layout, std::uint32_t frames) {
  const auto& pixels = file.pixels();
  if (!pixels) throw_unusable("The DICOM image has no pixel data.");
  check_syntax(file, layout);
  const std::uint64_t expected = layout.bytes_of(frames);
  if (!pixels->is_encapsulated && pixels->native.bytes < expected) {
    throw_unusable("The DICOM image's pixel data is truncated: " + std::to_string(layout.columns) +
                   " x " + std::to_string(layout.rows) + " x " + std::to_string(frames) +
                   " samples take " + std::to_string(expected) + " bytes, but the file has " +
                   std::to_string(pixels->native.bytes) + ".");
  }
  if (pixels->is_encapsulated && pixels->fragments.size() < frames) {
    throw_unusable("The DICOM image's pixel data is truncated: it has " + std::to_string(frames) +
                   " frames, but only " + std::to_string(pixels->fragments.size()) +
                   " compressed fragments.");
  }
  if (layout.bytes_of(1) > kMostFrameBytes) {
    throw_unusable("One frame of the DICOM image is " + std::to_string(layout.columns) + " x " +
                   std::to_string(layout.rows) + " samples, more than can be decoded.");
  }
}

}  // namespace isomesh::import::dicom
