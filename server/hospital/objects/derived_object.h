// The attributes that all objects made from a study's images have.
#pragma once

#include <chrono>
#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

#include "proto/types.h"
#include "server/hospital/objects/data_set.h"

namespace isomesh::dicom {

inline constexpr std::string_view kSegmentationStorage = "1.2.840.10008.5.1.4.1.1.66.4";
inline constexpr std::string_view kExplicitLittleEndian = "1.2.840.10008.1.2.1";

struct DerivedObject {
  const DicomIdentity& identity;  // of the images
  std::string sop_instance_uid;
  std::string series_uid;
  std::int64_t series_number = 0;
  std::int64_t instance_number = 1;
  std::string title;  // of the series
  std::chrono::system_clock::time_point made;
  std::string station_name;
};

// The modules of patient, study, series, equipment and SOP (PS3.3, C.7 and C.12), and the scanner
// as a contributor. Times are in UTC.
DataSet derived_object(const DerivedObject& object, std::string_view sop_class,
                       std::string_view modality);

// The frame of reference of the images. Objects of one series share one, even if the images have
// none.
void add_frame_of_reference(const DicomIdentity& identity, DataSet& data);

// An item of a sequence of codes.
DataSet code_item(const DicomCode& code);

// An item that refers to an object.
DataSet reference_to(std::string_view sop_class, std::string_view instance);

// Such items of all images.
std::vector<DataSet> references_to(const DicomIdentity& identity);

// An item of ReferencedSeriesSequence, with references to objects of that series.
DataSet series_item(std::string_view series_uid, const std::vector<DataSet>& references);

}  // namespace isomesh::dicom
