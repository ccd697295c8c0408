#include "tests/unit/import/dicom/segments.h"

#include "server/import/dicom/elements/tags.h"

namespace isomesh::import::test {

using namespace dicom;

namespace {

// Bits one after another, across frames.
std::string packed(const std::vector<SegmentFrame>& frames) {
  std::string bytes((frames.size() * kSegmentSamples + 15) / 16 * 2, '\0');
  for (std::size_t frame = 0; frame < frames.size(); ++frame) {
    for (const unsigned place : frames[frame].labels) {
      const std::size_t bit = frame * kSegmentSamples + place;
      bytes[bit / 8] = static_cast<char>(bytes[bit / 8] | 1 << bit % 8);
    }
  }
  return bytes;
}

// Each sample that has a label has the frame's value.
std::string unpacked(const std::vector<SegmentFrame>& frames) {
  std::string bytes(frames.size() * kSegmentSamples, '\0');
  for (std::size_t frame = 0; frame < frames.size(); ++frame) {
    for (const unsigned place : frames[frame].labels) {
      bytes[frame * kSegmentSamples + place] = static_cast<char>(frames[frame].value);
    }
  }
  return bytes;
}

}  // namespace

DicomObject segmentation(const SegmentObject& what) {
  const DicomSeries series = {.columns = kSegmentColumns, .rows = kSegmentRows, .uid = what.uid};
  DicomObject object = series.enhanced({0});
  std::vector<DicomObject> frames;
  for (const SegmentFrame& each : what.frames) {
    DicomObject frame = frame_at({0, 0, each.z});
    if (each.segment > 0) {
      frame.items(kSegmentIdentificationSequence,
                  {DicomObject().number(kReferencedSegmentNumber, each.segment)});
    }
    frames.push_back(frame);
  }
  std::vector<DicomObject> segments;
  for (const std::string& label : what.segments) {
    DicomObject segment;
    segment.number(kSegmentNumber, static_cast<unsigned>(segments.size() + 1))
        .text(kSegmentLabel, "LO", label);
    if (segments.size() < what.colors.size()) {
      segment.numbers(kRecommendedDisplayCieLabValue, what.colors[segments.size()]);
    }
    segments.push_back(segment);
  }
  DicomObject measures;
  measures.text(kPixelSpacing, "DS", "0.5\\0.75");
  if (!what.slice_distance.empty()) {
    measures.text(kSpacingBetweenSlices, "DS", what.slice_distance);
  }
  if (!what.thickness.empty()) measures.text(kSliceThickness, "DS", what.thickness);
  const DicomObject shared = shared_groups().items(kPixelMeasuresSequence, {measures});
  const bool is_binary = what.type == "BINARY";
  object.text(kModality, "CS", "SEG")
      .text(kNumberOfFrames, "IS", std::to_string(frames.size()))
      .text(kSegmentationType, "CS", what.type)
      .items(kSegmentSequence, segments)
      .items(kSharedFunctionalGroups, {shared})
      .items(kPerFrameFunctionalGroups, frames)
      .number(kBitsAllocated, is_binary ? 1 : 8)
      .number(kBitsStored, is_binary ? 1 : 8)
      .number(kHighBit, is_binary ? 0 : 7)
      .pixels(is_binary ? packed(what.frames) : unpacked(what.frames), 1);
  if (what.maximum > 0) object.number(kMaximumFractionalValue, what.maximum);
  return object;
}

SegmentObject two_segments() {
  return {.frames = {{.z = 0, .segment = 1, .labels = {0, 7}},
                     {.z = 2, .segment = 1, .labels = {14}},
                     {.z = 2, .segment = 2, .labels = {3}},
                     {.z = 4, .segment = 2, .labels = {1}}}};
}

}  // namespace isomesh::import::test
