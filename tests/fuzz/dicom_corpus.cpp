#include "tests/fuzz/dicom_corpus.h"

#include "server/import/dicom/elements/tags.h"
#include "tests/unit/import/dicom/mosaics.h"
#include "tests/unit/import/dicom/segments.h"
#include "tests/unit/import/dicom/structures.h"
#include "tests/unit/import/writers.h"

namespace isomesh::fuzz {

using namespace import::test;

// Padding as a range around the first sample.
DicomObject padded() {
  const DicomSeries series;
  return series.enhanced({0, 1, 2})
      .number(import::dicom::kPixelPaddingValue, static_cast<unsigned>(series.stored(0, 0, 0)))
      .number(import::dicom::kPixelPaddingRangeLimit, 7);
}

// Labels with colours in a plain table, and in a table of segments of all kinds.
DicomObject coloured(const SegmentObject& labels, bool is_segmented) {
  const std::string plain("\0\1\2\3\4\5\6\7", 8);
  const std::string segments("\0\2\0\x40\1\4\xFF\2\1\0\0\0\0\0", 14);
  DicomObject object = segmentation(labels);
  object.text(import::dicom::kPhotometricInterpretation, "CS", "PALETTE COLOR");
  const auto first =
      is_segmented ? import::dicom::kSegmentedRedPaletteData : import::dicom::kRedPaletteData;
  for (unsigned color = 0; color < 3; ++color) {
    object.numbers(import::dicom::kRedPaletteDescriptor + color, {8, 0, 8})
        .bytes(first + color, "OW", is_segmented ? segments : plain);
  }
  return object;
}

constexpr std::size_t kPreambleBytes = 132;  // with "DICM"

std::vector<std::string> dicom_objects() {
  std::vector<std::string> files;
  const SegmentObject labels = {.frames = {{.z = 0, .labels = {2}}, {.z = 5, .labels = {3}}},
                                .type = "LABELMAP",
                                .slice_distance = "2.5"};
  SegmentObject overlapping = two_segments();
  overlapping.frames[2].labels = {3, 14};
  overlapping.colors = {{35580, 53665, 50857}};
  SegmentObject fractional = overlapping;
  fractional.type = "FRACTIONAL";
  fractional.maximum = 10;
  for (const DicomObject& object :
       {siemens_mosaic(), siemens_mosaic(csa_fields({"0", "0", "-1"}), false),
        protocol_mosaic(true), united_imaging_grid(), segmentation(two_segments()),
        segmentation(labels), segmentation(overlapping), segmentation(fractional), padded(),
        coloured(labels, false), coloured(labels, true), DicomSeries{}.enhanced({0, 1, 2}),
        DicomSeries{}.enhanced({0, 1, 2, 0, 1, 2})}) {
    for (const std::string_view syntax : {kImplicit, kExplicit, kBigEndian}) {
      files.push_back(object.file(syntax));
    }
  }
  DicomObject slice = DicomSeries{}.slice(0);
  slice.text(import::dicom::kRescaleIntercept, "DS", "-1024")
      .text(import::dicom::kRescaleSlope, "DS", "1");
  // Without their beginnings, and with samples that are not what the syntax says.
  files.insert(files.end(), {slice.file(), slice.file().substr(kPreambleBytes), slice.bare(),
                             gzip(slice.file())});
  for (const std::string_view syntax : {"1.2.840.10008.1.2.5", "1.2.840.10008.1.2.4.70",
                                        "1.2.840.10008.1.2.4.80", "1.2.840.10008.1.2.4.90"}) {
    files.push_back(slice.file(syntax));
  }
  return files;
}

std::vector<std::string> csa_headers() {
  return {csa_header(csa_fields({"0", "0", "1"})), csa_header(csa_fields({"0", "0", "1"}), false)};
}

std::vector<std::string> structure_sets() {
  const TestContour large = {box(0, 0, 20, 20, 0)};
  const TestContour hole = {box(5, 5, 12, 12, 0), "CLOSEDPLANAR_XOR"};
  const TestContour above = {box(2, 2, 12, 18, 8)};
  const DicomObject object =
      structure_set({{.number = 1, .name = "ring", .contours = {large, hole, above}},
                     {.number = 7, .name = "box", .contours = {above, {{{1, 1, 1}}, "POINT"}}}});
  return {object.file(kImplicit), object.file(kExplicit)};
}

std::vector<std::string> siemens_protocols() {
  return {
      "SV10### ASCCONV BEGIN ###\nsSliceArray.lSize = 5\n"
      "sSliceArray.asSlice[0].sNormal.dTra = 1\nsSliceArray.asSlice[4].sPosition.dTra = 16\n"
      "### ASCCONV END ###\n"};
}

}  // namespace isomesh::fuzz
