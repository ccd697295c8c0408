#include "server/import/dicom/pixels.h"

#include <algorithm>
#include <string>

#include "server/import/dicom/decode.h"
#include "server/import/dicom/tags.h"
#include "server/import/source.h"

namespace isomesh::import::dicom {
namespace {

// Compressed samples may be larger than plain ones, but not by much.
std::uint64_t most_compressed_bytes(const PixelLayout& layout) {
  return layout.frame_bytes() * 2 + (std::uint64_t{1} << 20);
}

void swap_pairs(std::span<std::byte> bytes) {
  for (std::size_t at = 0; at + 1 < bytes.size(); at += 2) std::swap(bytes[at], bytes[at + 1]);
}

// Every compressed frame begins like this, whatever the syntax.
bool begins_frame(const DicomFile& file, const Extent& fragment) {
  const std::string head = file.bytes().text(fragment.offset, 4);
  return head.starts_with("\xFF\xD8\xFF") || head.starts_with("\xFF\x4F\xFF\x51");
}

bool is_one_of(const std::vector<std::uint64_t>& sorted, std::uint64_t value) {
  return std::binary_search(sorted.begin(), sorted.end(), value);
}

std::vector<std::size_t> first_fragments(const DicomFile& file, std::size_t frames) {
  const PixelElement& pixels = *file.pixels();
  const std::size_t fragments = pixels.fragments.size();
  const bool has_table = pixels.frame_offsets.size() == frames;
  std::vector<std::size_t> firsts;
  std::uint64_t offset = 0;  // of a fragment's item from the first one's
  for (std::size_t i = 0; i < fragments; ++i) {
    const bool is_first = fragments == frames || i == 0 ||
                          (frames > 1 && (has_table ? is_one_of(pixels.frame_offsets, offset)
                                                    : begins_frame(file, pixels.fragments[i])));
    if (is_first) firsts.push_back(i);
    offset += pixels.fragments[i].bytes + 8;
  }
  if (firsts.size() != frames) {
    throw_unusable("The DICOM image's compressed fragments cannot be told apart: " +
                   std::to_string(fragments) + " hold " + std::to_string(frames) + " frames.");
  }
  firsts.push_back(fragments);
  return firsts;
}

}  // namespace

FrameReader::FrameReader(const DicomFile& file, const Image& image)
    : file_(file), layout_(image.layout) {
  if (file.pixels()->is_encapsulated) first_fragments_ = first_fragments(file, image.frames.size());
}

void FrameReader::read(std::uint32_t frame, std::span<std::byte> target) const {
  if (!file_.pixels()->is_encapsulated) return read_native(frame, target);
  decode_frame(file_.transfer_syntax(), compressed(frame), layout_, target);
}

void FrameReader::read_native(std::uint32_t frame, std::span<std::byte> target) const {
  const PixelElement& pixels = *file_.pixels();
  const std::uint64_t offset = pixels.native.offset + frame * layout_.frame_bytes();
  if (file_.bytes().read(offset, target) != target.size()) {
    throw_unusable("the file ends before its samples do");
  }
  if (file_.transfer_syntax() != kExplicitBigEndian) return;
  if (layout_.bits_allocated > 8) {
    swap_bytes(target, layout_.bits_allocated / 8);
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
  if (bytes > most_compressed_bytes(layout_)) {
    throw_unusable("its compressed samples are far larger than its size tells");
  }
  std::vector<std::byte> result(bytes);
  std::span<std::byte> rest = result;
  for (std::size_t i = first; i < end; ++i) {
    file_.bytes().read(fragments[i].offset, rest.first(fragments[i].bytes));
    rest = rest.subspan(fragments[i].bytes);
  }
  return result;
}

}  // namespace isomesh::import::dicom
