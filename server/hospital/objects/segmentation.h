// Segmentation Storage (PS3.3, A.51): labels as an object of the study of their images. One bit for
// each sample and segment; frames in which a segment has nothing are left out.
#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "proto/types.h"
#include "server/hospital/objects/derived_object.h"

namespace isomesh::dicom {

struct SegmentationSegment {
  std::int64_t label = 0;  // in the label volume; the number of the segment is its place, from 1
  std::string name;
  std::optional<std::string> color = {};  // "#rrggbb"
};

struct SegmentationFrame {
  std::uint16_t segment = 0;  // its number
  std::uint32_t slice = 0;

  bool operator==(const SegmentationFrame&) const = default;
};

struct SegmentationObject {
  DerivedObject common;                             // the images have an instance for each slice
  std::array<std::uint32_t, 3> dims = {0, 0, 0};    // columns, rows, slices
  std::array<double, 3> origin = {0, 0, 0};         // LPS, in mm
  std::array<std::array<double, 3>, 3> steps = {};  // along columns, rows, slices
  std::vector<SegmentationSegment> segments;
  std::vector<SegmentationFrame> frames;  // in any order
};

// Memory of the functional groups: some hundred bytes for each frame.
inline constexpr std::size_t kMostFrames = 65'536;

// Throws Error kTooLarge for more frames than an object may have.
void check_frames(std::size_t frames);

// The bytes of the file before the pixel data, which are the last element. The bits of all frames
// follow without gaps: the first sample in the lowest bit, the end padded to an even number of
// bytes. Throws Error kTooLarge for more frames or bytes than an object may have.
std::string segmentation_head(const SegmentationObject& object);

// The bytes of the pixel data.
std::uint64_t segmentation_pixel_bytes(const SegmentationObject& object);

// CIELab, as RecommendedDisplayCIELabValue has it, of a color "#rrggbb".
std::array<std::uint16_t, 3> cielab_of(std::string_view color);

}  // namespace isomesh::dicom
