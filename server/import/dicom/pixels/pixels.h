// The layout of an object's samples (PS3.3, C.7.6.3), and the samples of its frames, plain or
// compressed.
#pragma once

#include <cstddef>
#include <functional>
#include <span>
#include <vector>

#include "server/import/dicom/geometry/image.h"

namespace isomesh::import::dicom {

// Supports 1, 8, 16 and 32 bits, and floating-point numbers of 32 and 64. Throws Error
// kUnusableVolume for colours, other sizes and contradictions.
PixelLayout pixel_layout(const DicomFile& file);

// Throws Error kUnusableVolume if the object has no pixels, fewer than `frames` need, or an
// unsupported transfer syntax.
void require_pixels(const DicomFile& file, const PixelLayout& layout, std::uint32_t frames);

// Gets a frame's stored values and their layout.
using SeeStored = std::function<void(std::span<const std::byte> stored, const PixelLayout& layout)>;

// Reads the frames of one file. The file and its description must outlive the reader. Not thread
// safe.
class FrameReader {
 public:
  // Throws Error kUnusableVolume if frames cannot be assigned to compressed fragments.
  FrameReader(const DicomFile& file, const Image& image);

  // Reads one frame of the image into `target`, which has layout.frame_bytes() bytes: little-endian
  // stored values, or those of the image's table; single bits as bytes. Throws Error
  // kUnusableVolume if the frame cannot be decoded or its size differs from the declared one.
  // `see`, if given, gets the stored values, also of an image with a table.
  void read(std::uint32_t frame, std::span<std::byte> target, const SeeStored& see = {});

 private:
  void read_by_table(std::uint32_t frame, std::span<std::byte> target, const SeeStored& see) const;
  void read_stored(std::uint32_t frame, std::span<std::byte> target) const;
  void read_bits(std::uint32_t frame, std::span<std::byte> target) const;
  void read_tile(std::uint32_t tile, std::span<std::byte> target);
  void read_native(std::uint32_t frame, std::span<std::byte> target) const;
  std::vector<std::byte> compressed(std::uint32_t frame) const;

  const DicomFile& file_;
  const Image& image_;
  const PixelLayout& stored_;
  std::vector<std::byte> mosaic_;  // the frame of all tiles, once read
  // The first fragment of each compressed frame, and the end of the last.
  std::vector<std::size_t> first_fragments_;
};

}  // namespace isomesh::import::dicom
