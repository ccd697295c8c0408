// One DICOM object that holds images: how its samples are stored and where each frame lies.
#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "server/import/dicom/elements/dataset.h"
#include "server/import/source/names.h"
#include "server/import/source/stored_samples.h"

namespace isomesh::import::dicom {

// How the samples of a frame are stored: one after another, rows from top to bottom.
struct PixelLayout {
  std::uint32_t columns = 0;
  std::uint32_t rows = 0;
  unsigned bits_allocated = 16;  // 1, 8, 16, 32 or 64
  unsigned bits_stored = 16;
  unsigned high_bit = 15;
  bool is_signed = false;
  bool is_float = false;

  std::uint64_t samples() const { return std::uint64_t{columns} * rows; }
  // Frames of single bits follow one another without a gap.
  std::uint64_t bytes_of(std::uint64_t frames) const {
    return (samples() * frames * bits_allocated + 7) / 8;
  }
  std::uint64_t frame_bytes() const { return bytes_of(1); }
  bool operator==(const PixelLayout&) const = default;
};

// Where a frame's samples lie, in the patient's space. All of its members are empty together when
// the object does not tell.
struct Plane {
  Vector3 position = {};               // of the first sample, in mm
  Vector3 along_row = {};              // unit vector from a sample to the next in its row
  Vector3 along_column = {};           // unit vector from a row to the next
  std::array<double, 2> spacing = {};  // mm, along the row and along the column
};

// The value of an attribute in which frames at the same position may differ.
struct Phase {
  std::size_t attribute = 0;  // its place in phase_names() (attributes.h)
  std::string value;

  bool operator==(const Phase&) const = default;
};

struct Frame {
  std::uint32_t number = 0;  // from 0, in its object
  Plane plane;
  Rescale rescale;
  std::uint32_t segment = 0;  // of a segmentation whose frames are one segment's; 0: none
  std::vector<Phase> phases;  // the frame's own
};

// A segment of a segmentation.
struct Segment {
  std::uint32_t number = 0;
  std::string label;                 // UTF-8
  std::optional<std::string> color;  // "#rrggbb"

  bool operator==(const Segment&) const = default;
};

// What the samples of a segmentation are.
enum class SegmentKind {
  kBinary,      // bits, in frames of one segment each
  kFractional,  // shares or probabilities, in such frames
  kLabelMap,    // numbers of segments
};

// What only segmentations (PS3.3, A.51 and A.108) have.
struct Segmentation {
  std::vector<Segment> segments;
  SegmentKind kind = SegmentKind::kBinary;
  std::uint32_t maximum = 1;             // of fractional samples
  std::optional<double> slice_distance;  // mm
};

struct Image {
  std::string file_name;  // without folders; empty when the upload is one file
  std::string frame_of_reference_uid;
  std::string modality;
  std::string rescale_type;  // the unit of rescaled samples: "HU" of a CT; may be empty
  std::string photometric;   // "MONOCHROME1" or "MONOCHROME2"
  std::optional<std::int64_t> instance_number;
  PixelLayout stored;  // of a frame in the file
  PixelLayout layout;  // of each of `frames`
  // Above 0 the file has one frame, in which `frames` lie as tiles, so many side by side.
  std::uint32_t tiles_per_row = 0;
  bool is_distance_assumed = false;  // the tiles' slices are as far apart as they are thick
  std::vector<Frame> frames;
  std::vector<Phase> phases;  // of the whole object
  std::optional<Segmentation> segmentation;
};

}  // namespace isomesh::import::dicom
