// JPEG XL (ISO/IEC 18181) by libjxl: one grey image, as a bare code stream or in a container.
#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>

#include "server/import/dicom/pixels/stream_size.h"

namespace isomesh::import::dicom {

// libjxl needs up to 20 bytes for each sample, and ends the process if it gets no memory.
inline constexpr std::uint64_t kMostJpegXlSamples = std::uint64_t{1} << 26;

// The size that the stream's header declares, without decoding its samples; empty if it is no such
// stream, or if its samples are floating-point numbers. A stream of several pictures that follow
// each other has none, too.
std::optional<StreamSize> jpeg_xl_size(std::span<const std::byte> stream);

// Decodes a stream whose size was compared with that of `target`: rows of unsigned integers of one
// or two bytes, little-endian. Returns false if the stream is truncated or corrupt.
bool decode_jpeg_xl(std::span<const std::byte> stream, const StreamSize& size,
                    std::size_t bytes_per_sample, std::span<std::byte> target);

}  // namespace isomesh::import::dicom
