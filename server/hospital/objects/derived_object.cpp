#include "server/hospital/objects/derived_object.h"

#include "base/clock.h"
#include "server/hospital/objects/uid.h"

namespace isomesh::dicom {
namespace {

struct Moment {
  std::string date;  // DA
  std::string time;  // TM
};

// In UTC. Without a time zone offset, because that would apply to the other times of the object
// too.
Moment moment_of(std::chrono::system_clock::time_point time) {
  return {utc_text(time, "%Y%m%d"), utc_text(time, "%H%M%S")};
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

}  // namespace

void add_frame_of_reference(const DicomIdentity& identity, DataSet& data) {
  const std::string frame =
      identity.frame_of_reference_uid.empty()
          ? name_based_uid("frame of reference\n" + identity.study_uid + '\n' + identity.series_uid)
          : identity.frame_of_reference_uid;
  data.set(0x00200052, "UI", frame);
  data.set(0x00201040, "LO", identity.position_reference_indicator);
}

DataSet code_item(const DicomCode& code) {
  DataSet item;
  item.set(0x00080100, "SH", code.value);    // CodeValue
  item.set(0x00080102, "SH", code.scheme);   // CodingSchemeDesignator
  item.set(0x00080104, "LO", code.meaning);  // CodeMeaning
  return item;
}

DataSet reference_to(std::string_view sop_class, std::string_view instance) {
  DataSet reference;
  reference.set(0x00081150, "UI", sop_class);
  reference.set(0x00081155, "UI", instance);
  return reference;
}

std::vector<DataSet> references_to(const DicomIdentity& identity) {
  std::vector<DataSet> references;
  for (const DicomInstance& image : identity.instances) {
    references.push_back(reference_to(image.sop_class_uid, image.sop_instance_uid));
  }
  return references;
}

DataSet series_item(std::string_view series_uid, const std::vector<DataSet>& references) {
  DataSet series;
  series.set_sequence(0x0008114A, references);  // ReferencedInstanceSequence
  series.set(0x0020000E, "UI", series_uid);
  return series;
}

DataSet derived_object(const DerivedObject& object, std::string_view sop_class,
                       std::string_view modality) {
  const Moment made = moment_of(object.made);
  DataSet data;
  data.set(0x00080005, "CS", "ISO_IR 192");  // SpecificCharacterSet
  data.set(0x00080012, "DA", made.date);     // InstanceCreationDate
  data.set(0x00080013, "TM", made.time);
  data.set(0x00080016, "UI", sop_class);
  data.set(0x00080018, "UI", object.sop_instance_uid);
  data.set(0x00080021, "DA", made.date);  // SeriesDate
  data.set(0x00080023, "DA", made.date);  // ContentDate
  data.set(0x00080031, "TM", made.time);
  data.set(0x00080033, "TM", made.time);
  data.set(0x00080060, "CS", modality);
  data.set(0x0008103E, "LO", object.title);  // SeriesDescription
  data.set(0x0020000E, "UI", object.series_uid);
  data.set(0x00200011, "IS", std::to_string(object.series_number));
  data.set(0x00200013, "IS", std::to_string(object.instance_number));
  data.set(0x00080070, "LO", "isomesh");            // Manufacturer
  data.set(0x00081090, "LO", "isomeshd");           // ManufacturerModelName
  data.set(0x00181000, "LO", object.station_name);  // DeviceSerialNumber
  data.set(0x00181020, "LO", ISOMESH_VERSION);      // SoftwareVersions
  add_patient_and_study(object.identity, data);
  add_scanner(object.identity.equipment, data);
  return data;
}

}  // namespace isomesh::dicom
