// A DICOM object with images: the layout of its samples and the geometry of its frames.
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

// The layout of a frame's samples: rows from top to bottom, without gaps.
struct PixelLayout {
  std::uint32_t columns = 0;
  std::uint32_t rows = 0;
  unsigned bits_allocated = 16;  // 1, 8, 16, 32 or 64
  unsigned bits_stored = 16;
  unsigned high_bit = 15;
  bool is_signed = false;
  bool is_float = false;

  std::uint64_t samples() const { return std::uint64_t{columns} * rows; }
  // Frames of single bits have no gaps between them.
  std::uint64_t bytes_of(std::uint64_t frames) const {
    return (samples() * frames * bits_allocated + 7) / 8;
  }
  std::uint64_t frame_bytes() const { return bytes_of(1); }
  bool operator==(const PixelLayout&) const = default;
};

// The geometry of a frame's samples in the patient's space. All members are empty if the object
// does not define it.
struct Plane {
  Vector3 position = {};               // of the first sample, in mm
  Vector3 along_row = {};              // unit vector from a sample to the next in the row
  Vector3 along_column = {};           // unit vector from a row to the next
  std::array<double, 2> spacing = {};  // mm, along the row and along the column
  // How the directions of the file differ from perpendicular unit vectors: in degrees, and as a
  // share of the length. 0 if they are used as they are.
  double skew = 0;
  double stretch = 0;
};

// The value of an attribute in which frames at one position may differ.
struct Phase {
  std::size_t attribute = 0;  // index in phase_names() (attributes.h)
  std::string value;

  bool operator==(const Phase&) const = default;
};

struct Frame {
  std::uint32_t number = 0;  // in its object, from 0
  Plane plane;
  Rescale rescale;
  // The object has this factor, or a table instead. A missing one is assumed.
  bool has_slope = false;
  bool has_intercept = false;
  std::uint32_t segment = 0;  // of a segmentation with one segment per frame; 0: none
  std::vector<Phase> phases;  // of this frame alone
};

struct Segment {
  std::uint32_t number = 0;
  std::string label;                 // UTF-8
  std::optional<std::string> color;  // "#rrggbb"

  bool operator==(const Segment&) const = default;
};

// The meaning of a segmentation's samples.
enum class SegmentKind {
  kBinary,      // bits; one segment per frame
  kFractional,  // occupancy or probability; one segment per frame
  kLabelMap,    // segment numbers
};

// Attributes of segmentations only (PS3.3, A.51 and A.108).
struct Segmentation {
  std::vector<Segment> segments;
  SegmentKind kind = SegmentKind::kBinary;
  std::uint32_t maximum = 1;             // of fractional samples
  std::optional<double> slice_distance;  // mm
  std::optional<double> thickness;       // of slices, mm
};

// Origin of the frames' positions.
enum class PlaceKind {
  kPatient,  // the patient's space
  kVolume,   // the space of an ultrasound volume, relative to the transducer
  kAssumed,  // the object has none
};

// A table that maps stored values to modality values (PS3.3, C.11.1). Stored values before the
// first have its value, and those behind the last have the last's.
struct ValueTable {
  std::int64_t first = 0;  // the stored value of values[0]
  std::vector<std::uint16_t> values;
};

// Stored values that are not part of the image, from the first to the last.
struct PaddingRange {
  double first = 0;
  double last = 0;
};

struct Image {
  std::string file_name;  // without folders; empty for a single uploaded file
  std::string frame_of_reference_uid;
  std::string modality;
  std::string rescale_type;  // the unit of rescaled samples: "HU" for CT; may be empty
  std::string photometric;   // "MONOCHROME1" or "MONOCHROME2"
  std::optional<std::int64_t> instance_number;
  PixelLayout stored;  // of a frame in the file
  PixelLayout layout;  // of each of `frames`, decoded
  // If nonzero, the file has one frame, with `frames` as tiles in rows of this length.
  std::uint32_t tiles_per_row = 0;
  bool is_distance_assumed = false;  // the frames' distance is their slice thickness
  // The object has one position for all frames. The others follow along the normal.
  bool has_one_position = false;
  bool may_be_times = false;         // those frames, by what the object says of their order
  bool is_distance_unknown = false;  // the frames are 1 mm apart instead
  PlaceKind place = PlaceKind::kPatient;
  // The most mappings to different real world values that a frame of a parametric map has.
  std::uint32_t value_mappings = 0;
  std::optional<PaddingRange> padding;
  std::optional<ValueTable> table;  // then `layout` has 16 unsigned bits
  std::vector<Frame> frames;
  std::vector<Phase> phases;  // of the whole object
  std::optional<Segmentation> segmentation;
};

}  // namespace isomesh::import::dicom
