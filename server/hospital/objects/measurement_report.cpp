#include "server/hospital/objects/measurement_report.h"

#include <algorithm>
#include <array>
#include <cstdio>
#include <utility>

#include "server/hospital/objects/data_set.h"
#include "server/hospital/objects/derived_object.h"
#include "server/hospital/objects/uid.h"

namespace isomesh::dicom {
namespace {

constexpr const char* kContains = "CONTAINS";
constexpr const char* kHasContext = "HAS OBS CONTEXT";
constexpr const char* kHasModifier = "HAS CONCEPT MOD";

// In the order of their use. IBSI: the codes of the Image Biomarker Standardisation Initiative in
// PS3.16, CID 7477.
const DicomCode kReport = {"126000", "DCM", "Imaging Measurement Report"};
const DicomCode kLanguage = {"121049", "DCM", "Language of Content Item and Descendants"};
const DicomCode kEnglish = {"en", "RFC5646", "English"};
const DicomCode kObserverType = {"121005", "DCM", "Observer Type"};
const DicomCode kDevice = {"121007", "DCM", "Device"};
const DicomCode kObserverUid = {"121012", "DCM", "Device Observer UID"};
const DicomCode kObserverName = {"121013", "DCM", "Device Observer Name"};
const DicomCode kObserverMaker = {"121014", "DCM", "Device Observer Manufacturer"};
const DicomCode kObserverModel = {"121015", "DCM", "Device Observer Model Name"};
const DicomCode kProcedureReported = {"121058", "DCM", "Procedure reported"};
const DicomCode kImagingProcedure = {"363679005", "SCT", "Imaging procedure"};
const DicomCode kImageLibrary = {"111028", "DCM", "Image Library"};
const DicomCode kImageLibraryGroup = {"126200", "DCM", "Image Library Group"};
const DicomCode kModality = {"121139", "DCM", "Modality"};
const DicomCode kMeasurements = {"126010", "DCM", "Imaging Measurements"};
const DicomCode kGroup = {"125007", "DCM", "Measurement Group"};
const DicomCode kTrackingName = {"112039", "DCM", "Tracking Identifier"};
const DicomCode kTrackingUid = {"112040", "DCM", "Tracking Unique Identifier"};
const DicomCode kFindingCategory = {"276214006", "SCT", "Finding category"};
const DicomCode kFinding = {"121071", "DCM", "Finding"};
const DicomCode kFindingSite = {"363698007", "SCT", "Finding Site"};
const DicomCode kReferencedSegment = {"121191", "DCM", "Referenced Segment"};
const DicomCode kSegmentedSeries = {"121232", "DCM", "Source series for segmentation"};
const DicomCode kVolume = {"RNU0", "IBSI", "Volume of Mesh"};
const DicomCode kArea = {"C0JK", "IBSI", "Surface Area of Mesh"};
const DicomCode kDiameter = {"L0JK", "IBSI", "Maximum 3D Diameter of a Mesh"};
const DicomCode kUncertainty = {"371884006", "SCT", "+/-, range of measurement uncertainty"};
const DicomCode kAlgorithmName = {"111001", "DCM", "Algorithm Name"};
const DicomCode kAlgorithmParameters = {"111002", "DCM", "Algorithm Parameters"};
const DicomCode kAlgorithmVersion = {"111003", "DCM", "Algorithm Version"};
// No standard code tells how far a mesh is from the surface that it stands for.
const DicomCode kDeviationBound = {"deviation-bound", "99ISOMESH",
                                   "No Point Is Farther from the Extracted Surface"};
const DicomCode kDeviationFound = {"deviation-found", "99ISOMESH",
                                   "Largest Distance Found from the Extracted Surface"};
const DicomCode kMm = {"mm", "UCUM", "mm"};
const DicomCode kMm2 = {"mm2", "UCUM", "mm2"};
const DicomCode kMm3 = {"mm3", "UCUM", "mm3"};

// A content item (PS3.3, C.17.3) without its value.
DataSet item(const char* relation, const char* type, const DicomCode& name) {
  DataSet item;
  item.set(0x0040A010, "CS", relation);              // RelationshipType
  item.set(0x0040A040, "CS", type);                  // ValueType
  item.set_sequence(0x0040A043, {code_item(name)});  // ConceptNameCodeSequence
  return item;
}

DataSet code(const char* relation, const DicomCode& name, const DicomCode& value) {
  DataSet content = item(relation, "CODE", name);
  content.set_sequence(0x0040A168, {code_item(value)});  // ConceptCodeSequence
  return content;
}

DataSet text(const char* relation, const DicomCode& name, std::string_view value) {
  DataSet content = item(relation, "TEXT", name);
  content.set(0x0040A160, "UT", value);  // TextValue
  return content;
}

DataSet uid(const char* relation, const DicomCode& name, std::string_view value) {
  DataSet content = item(relation, "UIDREF", name);
  content.set(0x0040A124, "UI", value);  // UID
  return content;
}

void fill_container(DataSet& content, const std::vector<DataSet>& children, const char* part_of) {
  content.set(0x0040A050, "CS", "SEPARATE");   // ContinuityOfContent
  content.set_sequence(0x0040A730, children);  // ContentSequence
  if (part_of == nullptr) return;
  DataSet by_template;
  by_template.set(0x00080105, "CS", "DCMR");        // MappingResource
  by_template.set(0x0040DB00, "CS", part_of);       // TemplateIdentifier
  content.set_sequence(0x0040A504, {by_template});  // ContentTemplateSequence
}

DataSet container(const DicomCode& name, const std::vector<DataSet>& children,
                  const char* by_template = nullptr) {
  DataSet content = item(kContains, "CONTAINER", name);
  fill_container(content, children, by_template);
  return content;
}

// As a decimal string (DS) of at most 16 characters.
std::string decimal_string(double value) {
  std::array<char, 32> digits = {};
  std::snprintf(digits.data(), digits.size(), "%.9g", value);
  return digits.data();
}

// An empty value means that there is none.
DataSet number(const char* relation, const DicomCode& name, const DicomCode& unit,
               std::optional<double> value, const std::vector<DataSet>& children = {}) {
  DataSet content = item(relation, "NUM", name);
  DataSet measured;
  if (value) {
    measured.set(0x0040A30A, "DS", decimal_string(*value));  // NumericValue
    measured.set_sequence(0x004008EA, {code_item(unit)});    // MeasurementUnitsCodeSequence
    content.set_sequence(0x0040A300, {measured});            // MeasuredValueSequence
  } else {
    content.set_sequence(0x0040A300, {});
    content.set_sequence(0x0040A301,  // NumericValueQualifierCodeSequence
                         {code_item({"114006", "DCM", "Measurement failure"})});
  }
  if (!children.empty()) content.set_sequence(0x0040A730, children);
  return content;
}

// Without a concept name if that is empty.
DataSet image(const char* relation, const std::optional<DicomCode>& name,
              const DicomInstance& instance, std::optional<std::int64_t> segment = {}) {
  DataSet content;
  content.set(0x0040A010, "CS", relation);
  content.set(0x0040A040, "CS", "IMAGE");
  if (name) content.set_sequence(0x0040A043, {code_item(*name)});
  DataSet reference = reference_to(instance.sop_class_uid, instance.sop_instance_uid);
  if (segment) {
    const auto low = static_cast<unsigned char>(*segment & 0xff);
    const auto high = static_cast<unsigned char>(*segment >> 8 & 0xff);
    const std::array<char, 2> bytes = {static_cast<char>(low), static_cast<char>(high)};
    reference.set_bytes(0x0062000B, "US", {bytes.data(), bytes.size()});  // ReferencedSegmentNumber
  }
  content.set_sequence(0x00081199, {reference});  // ReferencedSOPSequence
  return content;
}

// The segmentation of which the labels are segments, if that can be referred to.
const DicomInstance* segmentation_of(const MeasurementReport& report) {
  const DicomIdentity& identity = report.common.identity;
  const bool is_one = identity.instances.size() == 1 &&
                      identity.instances.front().sop_class_uid == kSegmentationStorage &&
                      !report.segmented_series_uid.empty();
  return is_one ? &identity.instances.front() : nullptr;
}

bool is_coded(const DicomCode& code) { return !code.value.empty() && !code.scheme.empty(); }

// The observer is this program (TID 1002, 1004).
void add_observer(const MeasurementReport& report, std::vector<DataSet>& children) {
  children.push_back(code(kHasContext, kObserverType, kDevice));
  children.push_back(
      uid(kHasContext, kObserverUid, name_based_uid("device\n" + report.common.station_name)));
  children.push_back(text(kHasContext, kObserverName, report.common.station_name));
  children.push_back(text(kHasContext, kObserverMaker, "isomesh"));
  children.push_back(text(kHasContext, kObserverModel, "isomeshd"));
}

// The images (TID 1600).
DataSet image_library(const DicomIdentity& identity) {
  constexpr std::array kModalities = {
      std::pair("CT", "Computed Tomography"), std::pair("MR", "Magnetic Resonance"),
      std::pair("PT", "Positron emission tomography"), std::pair("US", "Ultrasound")};
  std::vector<DataSet> images;
  if (!identity.modality.empty()) {
    const auto* known = std::ranges::find(kModalities, identity.modality,
                                          [](const auto& each) { return each.first; });
    const std::string meaning = known == kModalities.end() ? identity.modality : known->second;
    images.push_back(code("HAS ACQ CONTEXT", kModality, {identity.modality, "DCM", meaning}));
  }
  for (const DicomInstance& instance : identity.instances) {
    images.push_back(image(kContains, std::nullopt, instance));
  }
  return container(kImageLibrary, {container(kImageLibraryGroup, images)});
}

std::vector<DataSet> algorithm(const MeasurementReport& report) {
  std::vector<DataSet> items = {text(kHasModifier, kAlgorithmName, "isomesh marching tetrahedra"),
                                text(kHasModifier, kAlgorithmVersion, ISOMESH_VERSION)};
  if (!report.algorithm_parameters.empty()) {
    items.push_back(text(kHasModifier, kAlgorithmParameters, report.algorithm_parameters));
  }
  return items;
}

void add_measurements(const MeasurementReport& report, const MeasuredSurface& surface,
                      std::vector<DataSet>& children) {
  const std::vector<DataSet> by = algorithm(report);
  children.push_back(number(kContains, kVolume, kMm3, surface.volume_mm3, by));
  children.push_back(number(kContains, kArea, kMm2, surface.area_mm2, by));
  std::vector<DataSet> of_diameter = by;
  const auto& deviation = report.deviation;
  if (deviation && deviation->is_bound) {
    // Each end of a diameter is at most the bound away from a point of the other surface.
    of_diameter.push_back(number("HAS PROPERTIES", kUncertainty, kMm, 2 * deviation->mm));
  }
  children.push_back(number(kContains, kDiameter, kMm, surface.diameter_mm, of_diameter));
  if (deviation) {
    children.push_back(number(kContains, deviation->is_bound ? kDeviationBound : kDeviationFound,
                              kMm, deviation->mm));
  }
}

DataSet group(const MeasurementReport& report, const MeasuredSurface& surface) {
  const DicomIdentity& identity = report.common.identity;
  const std::string what = surface.label ? "label " + std::to_string(*surface.label) : "surface";
  std::vector<DataSet> children = {text(kHasContext, kTrackingName, surface.name),
                                   uid(kHasContext, kTrackingUid,
                                       name_based_uid("tracking\n" + identity.study_uid + '\n' +
                                                      identity.series_uid + '\n' + what))};
  const auto& segment = surface.segment;
  if (segment && is_coded(segment->category)) {
    children.push_back(code(kContains, kFindingCategory, segment->category));
  }
  if (segment && is_coded(segment->type)) {
    children.push_back(code(kContains, kFinding, segment->type));
  }
  const DicomInstance* segmentation = segment ? segmentation_of(report) : nullptr;
  if (segmentation != nullptr) {
    children.push_back(image(kContains, kReferencedSegment, *segmentation, segment->label));
    children.push_back(uid(kContains, kSegmentedSeries, report.segmented_series_uid));
  }
  if (segment && is_coded(segment->region)) {
    children.push_back(code(kHasModifier, kFindingSite, segment->region));
  }
  add_measurements(report, surface, children);
  return container(kGroup, children, segmentation == nullptr ? "1501" : "1411");
}

// The objects to which the report refers.
DataSet evidence(const DicomIdentity& identity) {
  DataSet series;
  series.set_sequence(0x00081199, references_to(identity));  // ReferencedSOPSequence
  series.set(0x0020000E, "UI", identity.series_uid);
  DataSet study;
  study.set_sequence(0x00081115, {series});  // ReferencedSeriesSequence
  study.set(0x0020000D, "UI", identity.study_uid);
  return study;
}

void add_content(const MeasurementReport& report, DataSet& data) {
  std::vector<DataSet> children = {code(kHasModifier, kLanguage, kEnglish)};
  add_observer(report, children);
  children.push_back(code(kHasModifier, kProcedureReported, kImagingProcedure));
  std::vector<DataSet> groups;
  for (const MeasuredSurface& surface : report.surfaces) groups.push_back(group(report, surface));
  if (segmentation_of(report) == nullptr) {
    children.push_back(image_library(report.common.identity));
  }
  children.push_back(container(kMeasurements, groups));
  data.set(0x0040A040, "CS", "CONTAINER");
  data.set_sequence(0x0040A043, {code_item(kReport)});
  fill_container(data, children, "1500");
}

}  // namespace

std::string make_report(const MeasurementReport& report) {
  DataSet data = derived_object(report.common, kEnhancedSrStorage, "SR");
  data.set_sequence(0x00081111, {});         // ReferencedPerformedProcedureStepSequence
  data.set_sequence(0x0040A372, {});         // PerformedProcedureCodeSequence
  data.set(0x0040A491, "CS", "COMPLETE");    // CompletionFlag
  data.set(0x0040A493, "CS", "UNVERIFIED");  // VerificationFlag
  data.set_sequence(0x0040A375, {evidence(report.common.identity)});  // of the requested procedure
  add_content(report, data);
  return file_head(kEnhancedSrStorage, report.common.sop_instance_uid, kExplicitLittleEndian) +
         data.bytes();
}

}  // namespace isomesh::dicom
