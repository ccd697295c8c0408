// Segmentations of a few samples.
#pragma once

#include <array>
#include <cstdint>
#include <string>
#include <vector>

#include "tests/unit/import/dicom/objects.h"

namespace isomesh::import::test {

inline constexpr std::uint32_t kSegmentColumns = 5;
inline constexpr std::uint32_t kSegmentRows = 3;
inline constexpr std::uint32_t kSegmentSamples = kSegmentColumns * kSegmentRows;

// A frame at z, of a segment or, with 0, of labels.
struct SegmentFrame {
  double z = 0;
  unsigned segment = 0;
  std::vector<unsigned> labels;  // of samples that have one, by their place
  unsigned value = 7;            // what those are, where they are no bits
};

struct SegmentObject {
  std::vector<SegmentFrame> frames;
  std::vector<std::string> segments = {"liver", "spleen"};
  std::string type = "BINARY";
  std::string slice_distance = {};
  std::string thickness = {};
  std::string uid = "1.2.3.4";
  unsigned maximum = 0;                              // of fractional samples; 0: not told
  std::vector<std::array<unsigned, 3>> colors = {};  // of the first segments, as they are stored
};

DicomObject segmentation(const SegmentObject& what);

// Three planes 2 mm apart, with both segments in the second.
SegmentObject two_segments();

}  // namespace isomesh::import::test
