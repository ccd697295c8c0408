#include "server/hospital/objects/encapsulated_stl.h"

#include <array>
#include <cstdio>
#include <ctime>
#include <utility>
#include <vector>

#include "proto/error.h"
#include "server/hospital/objects/data_set.h"
#include "server/hospital/objects/uid.h"

namespace isomesh::dicom {
namespace {

constexpr std::string_view kExplicitLittleEndian = "1.2.840.10008.1.2.1";
constexpr Tag kEncapsulatedDocument = 0x00420011;

struct Moment {
  std::string date;  // DA
  std::string time;  // TM
};

// In UTC. Without a time zone offset, because that would apply to the other times of the object
// too.
Moment moment_of(std::chrono::system_clock::time_point time) {
  const std::time_t seconds = std::chrono::system_clock::to_time_t(time);
  std::tm parts = {};
  ::gmtime_r(&seconds, &parts);
  std::array<char, 16> date = {};
  std::array<char, 16> clock = {};
  std::strftime(date.data(), date.size(), "%Y%m%d", &parts);
  std::strftime(clock.data(), clock.size(), "%H%M%S", &parts);
  return {date.data(), clock.data()};
}

DataSet code_item(const DicomCode& code) {
  DataSet item;
  item.set(0x00080100, "SH", code.value);    // CodeValue
  item.set(0x00080102, "SH", code.scheme);   // CodingSchemeDesignator
  item.set(0x00080104, "LO", code.meaning);  // CodeMeaning
  return item;
}

// Code of the kind of model: the segment's type, or else by the modality of the images (PS3.16, CID
// 7061).
std::optional<DicomCode> concept_of(const StlObject& object) {
  if (object.segment && !object.segment->type.value.empty()) return object.segment->type;
  const std::string& modality = object.identity.modality;
  if (modality == "CT") return DicomCode{"85040-4", "LN", "CT 3D CAM model"};
  if (modality == "MR") return DicomCode{"85041-2", "LN", "MR 3D CAM model"};
  if (modality == "US") return DicomCode{"129018", "DCM", "Ultrasound 3D CAM model"};
  return std::nullopt;
}

void add_patient_and_study(const DicomIdentity& identity, DataSet& data) {
  data.set(0x00080020, "DA", identity.study_date);
  data.set(0x00080030, "TM", identity.study_time);
  data.set(0x00080050, "SH", identity.accession_number);
  data.set(0x00080090, "PN", identity.referring_physician);
  data.set_told(0x00081030, "LO", identity.study_description);
  data.set(0x00100010, "PN", identity.patient_name);
  data.set(0x00100020, "LO", identity.patient_id);
  data.set_told(0x00100021, "LO", identity.issuer_of_patient_id);
  data.set(0x00100030, "DA", identity.patient_birth_date);
  data.set(0x00100040, "CS", identity.patient_sex);
  data.set_told(0x00120062, "CS", identity.patient_identity_removed);
  data.set_told(0x00120063, "LO", identity.deidentification_method);
  data.set(0x0020000D, "UI", identity.study_uid);
  data.set(0x00200010, "SH", identity.study_id);
}

void add_series_and_equipment(const StlObject& object, const Moment& made, DataSet& data) {
  const DicomIdentity& identity = object.identity;
  data.set(0x00080021, "DA", made.date);  // SeriesDate
  data.set(0x00080031, "TM", made.time);
  data.set(0x00080060, "CS", "M3D");
  data.set(0x0008103E, "LO", object.title);  // SeriesDescription
  data.set(0x0020000E, "UI", object.series_uid);
  data.set(0x00200011, "IS", std::to_string(object.series_number));
  // Meshes of one series share a frame of reference, even if the images have none.
  const std::string frame =
      identity.frame_of_reference_uid.empty()
          ? name_based_uid("frame of reference\n" + identity.study_uid + '\n' + identity.series_uid)
          : identity.frame_of_reference_uid;
  data.set(0x00200052, "UI", frame);
  data.set(0x00201040, "LO", identity.position_reference_indicator);
  data.set(0x00080070, "LO", "isomesh");            // Manufacturer
  data.set(0x00081090, "LO", "isomeshd");           // ManufacturerModelName
  data.set(0x00181000, "LO", object.station_name);  // DeviceSerialNumber
  data.set(0x00181020, "LO", ISOMESH_VERSION);      // SoftwareVersions
}

void add_sources(const DicomIdentity& identity, DataSet& data) {
  const DataSet purpose = code_item({"121324", "DCM", "Source Image"});
  std::vector<DataSet> sources;
  std::vector<DataSet> references;
  for (const DicomInstance& instance : identity.instances) {
    DataSet reference;
    reference.set(0x00081150, "UI", instance.sop_class_uid);
    reference.set(0x00081155, "UI", instance.sop_instance_uid);
    references.push_back(reference);
    reference.set_sequence(0x0040A170, {purpose});
    sources.push_back(std::move(reference));
  }
  data.set_sequence(0x00420013, sources);  // SourceInstanceSequence
  DataSet series;
  series.set_sequence(0x0008114A, references);  // ReferencedInstanceSequence
  series.set(0x0020000E, "UI", identity.series_uid);
  data.set_sequence(0x00081115, {series});  // ReferencedSeriesSequence
}

void add_scanner(const DicomEquipment& equipment, DataSet& data) {
  if (equipment == DicomEquipment()) return;
  DataSet item;
  item.set(0x00080070, "LO", equipment.manufacturer);
  item.set_told(0x00081010, "SH", equipment.station_name);
  item.set_told(0x00081090, "LO", equipment.model_name);
  item.set_told(0x00181000, "LO", equipment.device_serial_number);
  item.set_told(0x00181020, "LO", equipment.software_versions);
  item.set_sequence(0x0040A170, {code_item({"109101", "DCM", "Acquisition Equipment"})});
  data.set_sequence(0x0018A001, {item});  // ContributingEquipmentSequence
}

void add_document(const StlObject& object, const Moment& made, std::uint64_t bytes, DataSet& data) {
  data.set(0x00080023, "DA", made.date);  // ContentDate
  data.set(0x00080033, "TM", made.time);
  data.set(0x0008002A, "DT", object.identity.acquisition_datetime);
  data.set(0x00200013, "IS", "1");           // InstanceNumber
  data.set(0x00280301, "CS", "NO");          // BurnedInAnnotation
  data.set(0x00280302, "CS", "YES");         // RecognizableVisualFeatures
  data.set(0x00420010, "ST", object.title);  // DocumentTitle
  const auto concept_name = concept_of(object);
  data.set_sequence(0x0040A043,
                    concept_name ? std::vector{code_item(*concept_name)} : std::vector<DataSet>());
  if (object.segment && !object.segment->region.value.empty()) {
    data.set_sequence(0x00082218, {code_item(object.segment->region)});  // AnatomicRegionSequence
  }
  data.set(0x00420012, "LO", "model/stl");                       // MIMETypeOfEncapsulatedDocument
  data.set_long(0x00420015, static_cast<std::uint32_t>(bytes));  // EncapsulatedDocumentLength
}

void add_model(const StlObject& object, DataSet& data) {
  data.set_sequence(0x004008EA, {code_item({"mm", "UCUM", "mm"})});  // MeasurementUnitsCodeSequence
  data.set(0x00687001, "CS", "NO");                                  // ModelModification
  data.set(0x00687002, "CS", "NO");                                  // ModelMirroring
  data.set(0x00700081, "LO", object.content_description);            // ContentDescription
  DataSet algorithm;
  algorithm.set_sequence(0x0066002F, {code_item({"123103", "DCM", "Edge Detection"})});
  algorithm.set(0x00660031, "LO", ISOMESH_VERSION);                // AlgorithmVersion
  algorithm.set(0x00660032, "LT", object.algorithm_parameters);    // AlgorithmParameters
  algorithm.set(0x00660036, "LO", "isomesh marching tetrahedra");  // AlgorithmName
  data.set_sequence(0x00221612, {algorithm});                      // DerivationAlgorithmSequence
}

}  // namespace

StlEnvelope make_envelope(const StlObject& object, std::uint64_t stl_bytes) {
  if (stl_bytes > kMostDocumentBytes) {
    throw Error(ErrorCode::kTooLarge, "The mesh has " + std::to_string(stl_bytes) +
                                          " bytes, but a DICOM object holds at most " +
                                          std::to_string(kMostDocumentBytes) +
                                          ". Set \"triangles\" to simplify it.");
  }
  const Moment made = moment_of(object.made);
  DataSet data;
  data.set(0x00080005, "CS", "ISO_IR 192");  // SpecificCharacterSet
  data.set(0x00080012, "DA", made.date);     // InstanceCreationDate
  data.set(0x00080013, "TM", made.time);
  data.set(0x00080016, "UI", kEncapsulatedStlStorage);
  data.set(0x00080018, "UI", object.sop_instance_uid);
  add_patient_and_study(object.identity, data);
  add_series_and_equipment(object, made, data);
  add_sources(object.identity, data);
  add_scanner(object.identity.equipment, data);
  add_document(object, made, stl_bytes, data);
  add_model(object, data);
  const auto padded = static_cast<std::uint32_t>(stl_bytes + stl_bytes % 2);
  return {
      .before = file_head(kEncapsulatedStlStorage, object.sop_instance_uid, kExplicitLittleEndian) +
                data.bytes_before(kEncapsulatedDocument) +
                element_head(kEncapsulatedDocument, "OB", padded),
      .after = std::string(stl_bytes % 2, '\0') + data.bytes_after(kEncapsulatedDocument)};
}

}  // namespace isomesh::dicom
