#include "server/import/dicom/pixels/pixel_layout.h"

#include <algorithm>
#include <string>

#include "base/text.h"
#include "server/import/dicom/elements/tags.h"
#include "server/import/dicom/pixels/decode.h"
#include "server/import/source/source.h"

namespace isomesh::import::dicom {
namespace {

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
  if (samples == 1 && photometric.starts_with("MONOCHROME")) return;
  if (samples == 1 && photometric == "PALETTE COLOR") {
    // A segmentation's labels do not depend on its palette.
    if (!data.text(kSegmentationType).empty()) return;
    throw_unusable(
        "The DICOM image is in colour: its samples are indices into a palette. Only grey images "
        "are read.");
  }
  if (photometric.empty()) {
    throw_unusable("The DICOM image does not declare its photometric interpretation " +
                   tag_name(kPhotometricInterpretation) + ".");
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
