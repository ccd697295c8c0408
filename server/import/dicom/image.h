// One DICOM object that holds images: how its samples are stored and where each frame lies.
#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "server/import/dicom/dataset.h"
#include "server/import/names.h"
#include "server/import/stored_samples.h"

namespace isomesh::import::dicom {

// How the samples of a frame are stored: one after another, rows from top to bottom.
struct PixelLayout {
  std::uint32_t columns = 0;
  std::uint32_t rows = 0;
  unsigned bits_allocated = 16;  // 8, 16 or 32
  unsigned bits_stored = 16;
  unsigned high_bit = 15;
  bool is_signed = false;

  std::uint64_t samples() const { return std::uint64_t{columns} * rows; }
  std::uint64_t frame_bytes() const { return samples() * (bits_allocated / 8); }
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

// An attribute in which frames at the same position may differ, by its name in PS3.6.
struct Phase {
  std::string_view name;
  std::string value;

  bool operator==(const Phase&) const = default;
};

struct Frame {
  std::uint32_t number = 0;  // from 0, in its object
  Plane plane;
  Rescale rescale;
  std::vector<Phase> phases;
};

struct Image {
  std::string file_name;  // without folders; empty when the upload is one file
  std::string frame_of_reference_uid;
  std::string modality;
  std::string rescale_type;  // the unit of rescaled samples: "HU" of a CT; may be empty
  std::string photometric;   // "MONOCHROME1" or "MONOCHROME2"
  std::optional<std::int64_t> instance_number;
  PixelLayout layout;
  std::vector<Frame> frames;
};

// Why an object is no part of a volume: a localiser, a report, ... Empty when it is an image.
std::optional<std::string> reason_to_ignore(const DicomFile& file);

// Throws Error kUnusableVolume with the reason when the object holds no pixels, fewer than it
// tells, other ones than plain integers, or does not tell where its frames lie.
Image describe_image(const DicomFile& file);

}  // namespace isomesh::import::dicom
