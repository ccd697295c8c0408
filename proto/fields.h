// The fields of every type with a JSON form, for json_values.h and request_reader.h. `visit(value,
// field)` calls field(name, member) for each field, in the order of writing. The fields of a job's
// parameters are in parameters.h.
#pragma once

#include <type_traits>

#include "proto/error.h"
#include "proto/parameters.h"
#include "proto/stages.h"
#include "proto/types.h"

namespace isomesh {

inline constexpr const char* kAllLabels = "all";

void visit(Is<RawDescription> auto& self, auto&& field) {
  field("dims", self.dims);
  field("type", self.type);
  field("origin", self.geometry.origin);
  field("spacing", self.geometry.spacing);
  field("direction", self.geometry.direction);
  field("big_endian", self.big_endian);
}

void visit(Is<Preset> auto& self, auto&& field) {
  field("name", self.name);
  field("iso", self.iso);
}

void visit(Is<IgnoredObject> auto& self, auto&& field) {
  field("name", self.name);
  field("reason", self.reason);
}

void visit(Is<Note> auto& self, auto&& field) {
  field("code", self.code);
  field("detail", self.detail);
}

void visit(Is<LabelEntry> auto& self, auto&& field) {
  field("label", self.label);
  field("name", self.name);
  field("color", self.color);
  field("values", self.values);
}

void visit(Is<DicomInstance> auto& self, auto&& field) {
  field("sop_class_uid", self.sop_class_uid);
  field("sop_instance_uid", self.sop_instance_uid);
}

void visit(Is<DicomCode> auto& self, auto&& field) {
  field("value", self.value);
  field("scheme", self.scheme);
  field("meaning", self.meaning);
}

void visit(Is<DicomSegment> auto& self, auto&& field) {
  field("label", self.label);
  field("category", self.category);
  field("type", self.type);
  field("region", self.region);
}

void visit(Is<DicomEquipment> auto& self, auto&& field) {
  field("manufacturer", self.manufacturer);
  field("model_name", self.model_name);
  field("station_name", self.station_name);
  field("device_serial_number", self.device_serial_number);
  field("software_versions", self.software_versions);
}

void visit(Is<DicomIdentity> auto& self, auto&& field) {
  field("patient_name", self.patient_name);
  field("patient_id", self.patient_id);
  field("patient_birth_date", self.patient_birth_date);
  field("patient_sex", self.patient_sex);
  field("study_uid", self.study_uid);
  field("study_date", self.study_date);
  field("study_time", self.study_time);
  field("study_id", self.study_id);
  field("study_description", self.study_description);
  field("accession_number", self.accession_number);
  field("referring_physician", self.referring_physician);
  field("series_uid", self.series_uid);
  field("series_description", self.series_description);
  field("modality", self.modality);
  field("frame_of_reference_uid", self.frame_of_reference_uid);
  field("instances", self.instances);
  field("issuer_of_patient_id", self.issuer_of_patient_id);
  field("patient_identity_removed", self.patient_identity_removed);
  field("deidentification_method", self.deidentification_method);
  field("acquisition_datetime", self.acquisition_datetime);
  field("position_reference_indicator", self.position_reference_indicator);
  field("equipment", self.equipment);
  if (is_told(self, !self.segments.empty())) {
    field("segments", self.segments);
  }
}

void visit(Is<Volume> auto& self, auto&& field) {
  field("id", self.id);
  field("samples", self.samples);
  field("name", self.name);
  field("format", self.format);
  field("dims", self.dims);
  field("type", self.type);
  field("spacing", self.geometry.spacing);
  field("origin", self.geometry.origin);
  field("direction", self.geometry.direction);
  if (is_told(self, self.stored_axes.has_value())) {
    field("stored_axes", self.stored_axes);
  }
  field("range", self.range);
  field("suggested_iso", self.suggested_iso);
  field("bytes", self.bytes);
  field("created", self.created);
  field("modality", self.modality);
  field("presets", self.presets);
  field("ignored", self.ignored);
  field("notes", self.notes);
  if (is_told(self, self.dicom.has_value())) {
    field("dicom", self.dicom);
  }
  if constexpr (!std::is_const_v<std::remove_reference_t<decltype(self)>>) {
    field("labels", self.labels);  // written by to_record() alone
  }
}

void visit(Is<Callback> auto& self, auto&& field) {
  field(Parameter{.name = "url", .is_required = true}, self.url);
}

void visit(Is<Timing> auto& self, auto&& field) {
  for (const StageRow& row : kStages) {
    if (row.elapsed == nullptr) continue;
    // Servers of before a stage was added do not tell it.
    field(Parameter{.name = row.name, .may_be_absent = !row.is_always_run}, self.*row.elapsed);
  }
  field("total", self.total);
}

void visit(Is<MeshFile> auto& self, auto&& field) {
  field("bytes", self.bytes);
  field("sha256", self.sha256);
  field("href", self.href);
}

void visit(Is<MeshSummary::Enclosed> auto& self, auto&& field) {
  field("extracted", self.extracted);
  field("smoothed", self.smoothed);
}

void visit(Is<MeshSummary::Dropped> auto& self, auto&& field) {
  field("components", self.components);
  field("triangles", self.triangles);
}

void visit(Is<Distribution> auto& self, auto&& field) {
  field("mean", self.mean);
  field("min", self.min);
  field("histogram", self.histogram);
}

void visit(Is<MeshQuality::Stages> auto& self, auto&& field) {
  field("extracted", self.extracted);
  field("smoothed", self.smoothed);
}

void visit(Is<SelfIntersections> auto& self, auto&& field) {
  field("pairs", self.pairs);
  field("triangles", self.triangles);
  field("places", self.places);
}

void visit(Is<MeshQuality> auto& self, auto&& field) {
  field("closed", self.closed);
  field("manifold", self.manifold);
  field("oriented", self.oriented);
  field("components", self.components);
  field("genus", self.genus);
  field("aspect_ratio", self.aspect_ratio);
  field("smallest_angle_deg", self.smallest_angle_deg);
  field("encloses_volume", self.encloses_volume);
  if (is_told(self, self.self_intersections.has_value())) {
    field("self_intersections", self.self_intersections);
  }
}

void visit(Is<DistanceSummary> auto& self, auto&& field) {
  field("points", self.points);
  field("max_mm", self.max_mm);
  field("mean_mm", self.mean_mm);
  field("rms_mm", self.rms_mm);
  field("p99_mm", self.p99_mm);
  field("histogram", self.histogram);
}

void visit(Is<ErrorBudget> auto& self, auto&& field) {
  field("smoothing", self.smoothing);
  field("simplification", self.simplification);
  field("quantisation", self.quantisation);
}

void visit(Is<MeshCertificate> auto& self, auto&& field) {
  // Records of older servers lack it.
  std::optional<MeshCertificate::Reference> reference = self.reference;
  field("reference", reference);
  if constexpr (!std::is_const_v<std::remove_reference_t<decltype(self)>>) {
    self.reference = reference.value_or(MeshCertificate::Reference::kExtracted);
  }
  field("file", self.file);
  std::optional<bool> proven = self.bound_mm.has_value();
  field("proven", proven);
  if (is_told(self, self.bound_mm.has_value())) {
    field("bound_mm", self.bound_mm);
  }
  if (is_told(self, self.why_unproven.has_value())) {
    field("why_unproven", self.why_unproven);
  }
  field("found_mm", self.found_mm);
  field("from_mesh", self.from_mesh);
  field("from_extracted", self.from_extracted);
  if (is_told(self, self.budget_mm.has_value())) {
    field("budget_mm", self.budget_mm);
  }
}

void visit(Is<Thickness> auto& self, auto&& field) {
  field("thinnest_mm", self.thinnest_mm);
  field("place", self.place);
  field("thin_area_mm2", self.thin_area_mm2);
}

void visit(Is<Untangling> auto& self, auto&& field) {
  field("pairs", self.pairs);
  field("vertices", self.vertices);
  field("left", self.left);
}

void visit(Is<Simplification> auto& self, auto&& field) {
  field("triangles_before", self.triangles_before);
  field("bound_by", self.bound_by);
}

void visit(Is<MeshSummary::Displacement> auto& self, auto&& field) {
  field("mean", self.mean);
  field("max", self.max);
}

void visit(Is<LabelFile> auto& self, auto&& field) {
  field("bytes", self.bytes);
  field("sha256", self.sha256);
  field("offset", self.offset);
  field("href", self.href);
}

void visit(Is<LabelSummary> auto& self, auto&& field) {
  field("label", self.label);
  field("name", self.name);
  field("color", self.color);
  field("voxels", self.voxels);
  field("voxels_mm3", self.voxels_mm3);
  field("triangles", self.triangles);
  field("vertices", self.vertices);
  field("closed", self.closed);
  field("manifold", self.manifold);
  field("oriented", self.oriented);
  field("components", self.components);
  field("area_mm2", self.area_mm2);
  field("volume_mm3", self.volume_mm3);
  field("files", self.files);
}

void visit(Is<WallSummary> auto& self, auto&& field) {
  field("a", self.a);
  field("b", self.b);
  field("area_mm2", self.area_mm2);
  if (is_told(self, self.faces.has_value())) {
    field("faces", self.faces);
  }
  field("a_name", self.a_name);
  field("b_name", self.b_name);
}

void visit(Is<LabelListFile> auto& self, auto&& field) {
  field("bytes", self.bytes);
  field("sha256", self.sha256);
}

void visit(Is<MeshSummary> auto& self, auto&& field) {
  if (is_told(self, self.iso.has_value())) {
    field("iso", self.iso);
  }
  field("empty", self.empty);
  if (is_told(self, self.empty_reason.has_value())) {
    field("empty_reason", self.empty_reason);
  }
  field("triangles", self.triangles);
  field("vertices", self.vertices);
  field("boundary_edges", self.boundary_edges);
  field("components", self.components);
  field("euler", self.euler);
  field("dropped", self.dropped);
  if (is_told(self, self.untangled.has_value())) {
    field("untangled", self.untangled);
  }
  if (is_told(self, self.simplified.has_value())) {
    field("simplified", self.simplified);
  }
  field("quality", self.quality);
  field("area_mm2", self.area_mm2);
  field("area_extracted_mm2", self.area_extracted_mm2);
  field("volume_mm3", self.volume_mm3);
  field("displacement_mm", self.displacement_mm);
  field("bounds", self.bounds);
  field("files", self.files);
  if (is_told(self, !self.labels.empty())) {
    field("labels", self.labels);
  }
  if (is_told(self, self.labels_count.has_value())) {
    field("labels_count", self.labels_count);
  }
  if (is_told(self, self.walls_count.has_value())) {
    field("walls_count", self.walls_count);
  }
  if (is_told(self, self.edge_contacts_count.has_value())) {
    field("edge_contacts_count", self.edge_contacts_count);
  }
  if constexpr (!std::is_const_v<std::remove_reference_t<decltype(self)>>) {
    field("label_list", self.label_list);  // written by to_record() alone
    field("wall_list", self.wall_list);
  }
  if (is_told(self, self.certificate.has_value())) {
    field("certificate", self.certificate);
  }
  if (is_told(self, self.thickness.has_value())) {
    field("thickness", self.thickness);
  }
  if (is_told(self, !self.notes.empty())) {
    field("notes", self.notes);
  }
}

void visit(Is<FieldError> auto& self, auto&& field) {
  field("field", self.field);
  field("message", self.message);
}

void visit(Is<ChoicePicture> auto& self, auto&& field) {
  field("width", self.width);
  field("height", self.height);
  field("grey", self.grey);
}

void visit(Is<SeriesFacts> auto& self, auto&& field) {
  field("patient_name", self.patient_name);
  field("patient_id", self.patient_id);
  field("study_uid", self.study_uid);
  field("study_description", self.study_description);
  field("study_date", self.study_date);
}

void visit(Is<Choice> auto& self, auto&& field) {
  field("parameter", self.parameter);
  field("value", self.value);
  field("title", self.title);
  if (is_told(self, self.series.has_value())) {
    field("series", self.series);
  }
  if (is_told(self, self.picture.has_value())) {
    field("picture", self.picture);
  }
}

void visit(Is<Problem> auto& self, auto&& field) {
  field("type", self.type);
  field("title", self.title);
  field("status", self.status);
  field("detail", self.detail);
  if (is_told(self, !self.instance.empty())) {
    field("instance", self.instance);
  }
  if (is_told(self, !self.errors.empty())) {
    field("errors", self.errors);
  }
  if (is_told(self, !self.remedy.overridable.empty())) {
    field("overridable", self.remedy.overridable);
  }
  if (is_told(self, !self.remedy.choices.empty())) {
    field("choices", self.remedy.choices);
  }
}

void visit(Is<UploadedVolume> auto& self, auto&& field) {
  field("member", self.member);
  field("status", self.status);
  field("volume", self.volume);
  field("problem", self.problem);
}

// `volume` and `priority` repeat members of the parameters, which are authoritative.
void visit(Is<Job> auto& self, auto&& field) {
  field("id", self.id);
  field("state", self.state);
  field("stage", self.stage);
  field("progress", self.progress);
  field("parameters", self.parameters);
  field("volume", self.parameters.volume);
  field("priority", self.parameters.priority);
  field("created", self.created);
  field("started", self.started);
  field("finished", self.finished);
  field("timing", self.timing);
  field("mesh", self.mesh);
  field("error", self.error);
  field("reused", self.reused);
  field("waiting_for", self.waiting_for);
}

void visit(Is<JobEvent> auto& self, auto&& field) {
  field("state", self.state);
  field("stage", self.stage);
  field("progress", self.progress);
}

void visit(Is<Histogram> auto& self, auto&& field) {
  field("volume", self.volume);
  field("range", self.range);
  field("counts", self.counts);
}

void visit(Is<VolumeLabel> auto& self, auto&& field) {
  field("label", self.label);
  field("voxels", self.voxels);
  field("volume_mm3", self.volume_mm3);
  field("low", self.low);
  field("high", self.high);
  field("bounds", self.bounds);
  field("name", self.name);
  field("color", self.color);
}

void visit(Is<VolumeLabels> auto& self, auto&& field) {
  field("volume", self.volume);
  field("background", self.background);
  field("labels", self.labels);
  field("next", self.next);
}

void visit(Is<Estimate::Queue> auto& self, auto&& field) {
  field("queued", self.queued);
  field("running", self.running);
}

void visit(Is<Estimate::Label> auto& self, auto&& field) {
  field("label", self.label);
  field("triangles", self.triangles);
}

void visit(Is<Estimate> auto& self, auto&& field) {
  field("volume", self.volume);
  if (is_told(self, self.iso.has_value())) {
    field("iso", self.iso);
  }
  field("scheme", self.scheme);
  field("triangles", self.triangles);
  field("vertices", self.vertices);
  if (is_told(self, self.simplified_triangles.has_value())) {
    field("simplified_triangles", self.simplified_triangles);
  }
  field("bytes", self.bytes);
  field("memory_bytes", self.memory_bytes);
  field("fits", self.fits);
  field("milliseconds", self.milliseconds);
  field("queue", self.queue);
  if (is_told(self, !self.labels.empty())) {
    field("labels", self.labels);
  }
  if (is_told(self, self.labels_count.has_value())) {
    field("labels_count", self.labels_count);
  }
}

}  // namespace isomesh
