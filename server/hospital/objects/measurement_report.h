// A structured report of measurements on surfaces: Enhanced SR Storage (PS3.3, A.35.2) by the
// templates of a Measurement Report (PS3.16, TID 1500).
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "proto/types.h"
#include "server/hospital/objects/derived_object.h"

namespace isomesh::dicom {

inline constexpr std::string_view kEnhancedSrStorage = "1.2.840.10008.5.1.4.1.1.88.22";

// One surface.
struct MeasuredSurface {
  std::string name;
  std::optional<std::int64_t> label = {};
  std::optional<DicomSegment> segment = {};  // the label's codes
  std::optional<double> volume_mm3 = {};     // empty: the surface encloses none
  bool is_inside_out = false;                // so it encloses none, although it is closed
  double area_mm2 = 0;
  double diameter_mm = 0;  // the largest distance of two vertices
};

// How far the meshes are from the surfaces as they were extracted from the images.
struct Deviation {
  double mm = 0;
  bool is_bound = false;  // no point is farther; otherwise the largest distance that was found
};

struct MeasurementReport {
  DerivedObject common;
  std::string segmented_series_uid = {};  // of a segmentation: the series of its images, if known
  std::string algorithm_parameters;       // JSON
  std::optional<Deviation> deviation = {};
  std::vector<MeasuredSurface> surfaces = {};
};

// The bytes of the file. A label of a segmentation has a group of volumetric ROI measurements (TID
// 1411), which refers to its segment; other surfaces have a measurement group (TID 1501), and the
// report lists the images. Texts are UTF-8.
std::string make_report(const MeasurementReport& report);

}  // namespace isomesh::dicom
