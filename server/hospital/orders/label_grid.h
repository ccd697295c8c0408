// A label volume on the grid of a series: the same samples, perhaps in another order. Volumes are
// stored along the patient's axes, while images have rows and columns of their own.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <span>
#include <stop_token>
#include <string>
#include <vector>

#include "proto/types.h"
#include "server/hospital/objects/segmentation.h"
#include "server/store/blob_store.h"

namespace isomesh::orders {

struct LabelGrid {
  std::array<std::uint32_t, 3> dims = {0, 0, 0};  // columns, rows, slices
  SampleType type = SampleType::kUint8;
  std::string samples;                          // the key of the blob of the label volume
  std::array<std::size_t, 3> axes = {0, 1, 2};  // the label volume's axis along each of the images'
  std::array<bool, 3> is_flipped = {};          // along each axis of the images
  std::array<double, 3> origin = {0, 0, 0};     // of the images
  std::array<std::array<double, 3>, 3> steps = {};
  std::size_t window_bytes = std::size_t{64} << 20;  // of slices across the layers of the file
};

// The lattice of a series along its columns, rows and slices.
struct ImageLattice {
  std::array<std::uint32_t, 3> dims = {0, 0, 0};
  Geometry geometry;
};

// The order of the samples in the file (Volume::stored_axes) is that of the images.
ImageLattice images_of(const Volume& series);

// The sizes of the label volume along the columns, rows and slices of the images.
std::array<std::uint32_t, 3> dims_along(const Geometry& images, const Volume& labels);

// `images` is the geometry of the series, along its columns, rows and slices, and `dims` their
// numbers. Throws Error kUnusableVolume, with the reason, for label volumes that have other sizes,
// are elsewhere, or have labels that share values.
LabelGrid label_grid(const Geometry& images, const std::array<std::uint32_t, 3>& dims,
                     const Volume& labels);

// The slices where the segments have samples, by segment, then by slice. If slices lie across the
// layers of the file, windows of them come one after another, so that write_frames reads each
// window once. Takes the memory of a window (`window_bytes`, or one slice), or a bit for each slice
// of each label. `labels` are those of the segments. Throws Error kCancelled, kTooLarge for more
// frames than an object may have, and kInternal if the blob is damaged.
std::vector<dicom::SegmentationFrame> frames_of(const LabelGrid& grid,
                                                std::span<const std::int64_t> labels,
                                                const store::BlobStore& blobs,
                                                const std::stop_token& stop);

// The bits of those frames, in pieces, with the padding at the end.
void write_frames(const LabelGrid& grid, std::span<const std::int64_t> labels,
                  std::span<const dicom::SegmentationFrame> frames, const store::BlobStore& blobs,
                  const std::stop_token& stop,
                  const std::function<void(std::span<const std::byte>)>& write);

}  // namespace isomesh::orders
