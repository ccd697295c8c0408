#include "server/hospital/objects/encapsulated_document.h"

#include <algorithm>
#include <array>
#include <cstdio>
#include <vector>

#include "proto/error.h"
#include "server/hospital/objects/data_set.h"
#include "server/hospital/objects/derived_object.h"
#include "server/hospital/objects/measurement_report.h"
#include "server/hospital/protocol/orders.h"

namespace isomesh::dicom {
namespace {

constexpr Tag kEncapsulatedDocument = 0x00420011;

struct KindRow {
  DocumentKind kind;
  std::string_view sop_class;
  std::string_view name;
  std::string_view media_type;
};

constexpr std::array kKinds = {
    KindRow{DocumentKind::kStl, kEncapsulatedStlStorage, "Encapsulated STL", "model/stl"},
    KindRow{DocumentKind::kObj, "1.2.840.10008.5.1.4.1.1.104.4", "Encapsulated OBJ", "model/obj"},
    KindRow{DocumentKind::kMtl, "1.2.840.10008.5.1.4.1.1.104.5", "Encapsulated MTL", "model/mtl"}};

const KindRow& row_of(DocumentKind kind) {
  return *std::ranges::find(kKinds, kind, &KindRow::kind);
}

// Code of the kind of model: the segment's type, or else by the modality of the images (PS3.16, CID
// 7061).
std::optional<DicomCode> concept_of(const DocumentObject& object) {
  if (object.segment && !object.segment->type.value.empty()) return object.segment->type;
  const std::string& modality = object.common.identity.modality;
  if (modality == "CT") return DicomCode{"85040-4", "LN", "CT 3D CAM model"};
  if (modality == "MR") return DicomCode{"85041-2", "LN", "MR 3D CAM model"};
  if (modality == "US") return DicomCode{"129018", "DCM", "Ultrasound 3D CAM model"};
  return std::nullopt;
}

void add_references(const DocumentObject& object, DataSet& data) {
  const DataSet purpose = code_item({"121324", "DCM", "Source Image"});
  const std::vector<DataSet> references = references_to(object.common.identity);
  std::vector<DataSet> sources = references;
  for (DataSet& source : sources) source.set_sequence(0x0040A170, {purpose});
  data.set_sequence(0x00420013, sources);  // SourceInstanceSequence
  std::vector<DataSet> series = {series_item(object.common.identity.series_uid, references)};
  if (!object.materials_uid.empty()) {
    DataSet materials = reference_to(sop_class_of(DocumentKind::kMtl), object.materials_uid);
    series.push_back(series_item(object.common.series_uid, {materials}));
    materials.set(0x00687005, "UR",
                  kMaterialsName);               // RelativeURIReferenceWithinEncapsulatedDocument
    data.set_sequence(0x0008114A, {materials});  // ReferencedInstanceSequence
  }
  data.set_sequence(0x00081115, series);  // ReferencedSeriesSequence
}

void add_document(const DocumentObject& object, std::uint64_t bytes, DataSet& data) {
  data.set(0x0008002A, "DT", object.common.identity.acquisition_datetime);
  data.set(0x00280301, "CS", "NO");                 // BurnedInAnnotation
  data.set(0x00280302, "CS", "YES");                // RecognizableVisualFeatures
  data.set(0x00420010, "ST", object.common.title);  // DocumentTitle
  const auto concept_name = concept_of(object);
  data.set_sequence(0x0040A043,
                    concept_name ? std::vector{code_item(*concept_name)} : std::vector<DataSet>());
  if (object.segment && !object.segment->region.value.empty()) {
    data.set_sequence(0x00082218, {code_item(object.segment->region)});  // AnatomicRegionSequence
  }
  data.set(0x00420012, "LO", row_of(object.kind).media_type);    // MIMETypeOfEncapsulatedDocument
  data.set_long(0x00420015, static_cast<std::uint32_t>(bytes));  // EncapsulatedDocumentLength
}

void add_model(const DocumentObject& object, DataSet& data) {
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

std::string_view sop_class_of(DocumentKind kind) { return row_of(kind).sop_class; }

std::string_view name_of_class(std::string_view sop_class) {
  const auto* row = std::ranges::find(kKinds, sop_class, &KindRow::sop_class);
  if (row != kKinds.end()) return row->name;
  if (sop_class == kEnhancedSrStorage) return "Enhanced SR";
  if (sop_class == kSegmentationStorage) return "Segmentation";
  throw Error(ErrorCode::kInternal, "an object of an unknown class");
}

Envelope make_envelope(const DocumentObject& object, std::uint64_t document_bytes) {
  if (document_bytes > kMostDocumentBytes) {
    throw Error(ErrorCode::kTooLarge, "The document has " + std::to_string(document_bytes) +
                                          " bytes, but a DICOM object holds at most " +
                                          std::to_string(kMostDocumentBytes) +
                                          ". Set \"triangles\" to simplify it.");
  }
  const std::string_view sop_class = sop_class_of(object.kind);
  DataSet data = derived_object(object.common, sop_class, "M3D");
  add_frame_of_reference(object.common.identity, data);
  add_references(object, data);
  add_document(object, document_bytes, data);
  add_model(object, data);
  const auto padded = static_cast<std::uint32_t>(document_bytes + document_bytes % 2);
  return {.before = file_head(sop_class, object.common.sop_instance_uid, kExplicitLittleEndian) +
                    data.bytes_before(kEncapsulatedDocument) +
                    element_head(kEncapsulatedDocument, "OB", padded),
          .after = std::string(document_bytes % 2, '\0') + data.bytes_after(kEncapsulatedDocument)};
}

}  // namespace isomesh::dicom
