#include "tests/unit/proto/answers.h"

namespace isomesh::test {
namespace {

Distribution some_distribution(double mean) {
  Distribution distribution = {.mean = mean, .min = 0.25};
  distribution.histogram[0] = 1;
  distribution.histogram[19] = 5091319;
  return distribution;
}

MeshSummary some_mesh() {
  return {
      .triangles = 5091320,
      .vertices = 2544488,
      .boundary_edges = 7,
      .components = 12,
      .euler = -35,
      .dropped = {.components = 3, .triangles = 48},
      .quality = {.closed = true,
                  .manifold = true,
                  .oriented = false,
                  .components = 12,
                  .genus = 29,
                  .aspect_ratio = {some_distribution(0.5), some_distribution(0.75)},
                  .smallest_angle_deg = {some_distribution(30), some_distribution(40)}},
      .area_mm2 = 593150.7,
      .area_extracted_mm2 = 600000.5,
      .volume_mm3 = {.extracted = 2795793.9, .smoothed = 2790000.25},
      .displacement_mm = {.mean = 0.25, .max = 1.75},
      .bounds = {{{-1, -2, -3}, {1, 2, 3}}},
      .files = {{MeshFormat::kDrc, {.bytes = 1, .sha256 = "aa", .href = "/v1/jobs/7/mesh.drc"}},
                {MeshFormat::kObj, {.bytes = 2, .sha256 = "bb", .href = "/v1/jobs/7/mesh.obj"}}}};
}

}  // namespace

Volume some_volume() {
  return {.id = "0123abcd",
          .samples = "4567cdef",
          .format = "nifti",
          .dims = {181, 217, 4294967295},
          .type = SampleType::kFloat32,
          .geometry = {.origin = {-90.5, 126, -72},
                       .spacing = {0.1, 1.0 / 3, 2},
                       .direction = {0, 1, 0, -1, 0, 0, 0, 0, 1}},
          .range = {-1024, 3071.5},
          .suggested_iso = 59.25,
          .bytes = 18446744073709551615U,
          .created = "2024-05-01T10:00:00.123Z",
          .modality = {},
          .presets = {},
          .ignored = {},
          .dicom = {}};
}

Volume dicom_volume() {
  Volume volume = some_volume();
  volume.format = "dicom";
  volume.modality = "CT";
  volume.presets = {{"skin", -300}, {"bone", 250}};
  volume.name = "M\xc3\xbcller CT";
  volume.notes = {{"frame-of-reference", "Every slice has another one."}};
  volume.ignored = {{"DICOMDIR", "it is a directory of DICOM files"}};
  volume.dicom = DicomIdentity{.patient_name = "M\xc3\xbcller^Eva",
                               .patient_id = "4711",
                               .patient_birth_date = "19700101",
                               .patient_sex = "F",
                               .study_uid = "1.2.3",
                               .study_date = "20240501",
                               .study_time = "101112",
                               .study_id = "S1",
                               .study_description = "head",
                               .accession_number = "A1",
                               .referring_physician = "Roe^Jane",
                               .series_uid = "1.2.3.4",
                               .series_description = "axial",
                               .modality = "CT",
                               .frame_of_reference_uid = "1.2.3.5",
                               .instances = {{"1.2.840.10008.5.1.4.1.1.2", "1.2.3.4.1"},
                                             {"1.2.840.10008.5.1.4.1.1.2", "1.2.3.4.2"}},
                               .issuer_of_patient_id = "Hospital",
                               .patient_identity_removed = "YES",
                               .deidentification_method = "by hand",
                               .acquisition_datetime = "20240501101500",
                               .position_reference_indicator = "SN",
                               .equipment = {.manufacturer = "Maker",
                                             .model_name = "X",
                                             .station_name = "CT-2",
                                             .device_serial_number = "77",
                                             .software_versions = "VB20"},
                               .segments = {{.label = 3,
                                             .category = {"123037004", "SCT", "Structure"},
                                             .type = {"10200004", "SCT", "Liver"},
                                             .region = {}}}};
  return volume;
}

JobParameters some_parameters() {
  return {{.iso = -0.1,
           .scheme = SchemeName::kFive,
           .interpolation = Interpolation::kMidpoint,
           .passes = 1000,
           .smoothing = Smoothing::kTaubin,
           .lambda = 0.3,
           .pass_band = 0.2,
           .max_displacement_mm = 1.5,
           .close = true,
           .components = {.keep = 4294967295, .min_triangles = {}, .nearest_to = {}},
           .formats = {MeshFormat::kStl, MeshFormat::kDrc},
           .draco = {.position_bits = 30, .speed = 0},
           .normals = true},
          {},
          "0123abcd",
          Priority::kStat};
}

Problem some_problem() {
  return {.type = "urn:isomesh:problem:invalid-parameter",
          .title = "Invalid parameter",
          .status = 400,
          .detail = "iso: is required",
          .instance = "/v1/jobs",
          .errors = {{"iso", "is required"}, {"volume", "is required"}},
          .remedy = {.overridable = "frame-of-reference",
                     .choices = {{"volume", "0", "0 s"}, {"volume", "1", "2 s"}}}};
}

Job queued_job() {
  Job job;
  job.id = "018f-7";
  job.parameters = some_parameters();
  job.created = "2024-05-01T10:00:00.123Z";
  return job;
}

Job succeeded_job() {
  Job job = queued_job();
  job.state = JobState::kSucceeded;
  job.stage = Stage::kDone;
  job.progress = 1;
  job.started = "2024-05-01T10:00:01.000Z";
  job.finished = "2024-05-01T10:00:02.000Z";
  job.timing = {.queue = 0.5, .load = 1, .extract = 2, .smooth = 3, .encode = 4, .total = 11};
  job.mesh = some_mesh();
  return job;
}

Job failed_job() {
  Job job = queued_job();
  job.state = JobState::kFailed;
  job.stage = Stage::kExtract;
  job.started = job.created;
  job.finished = job.created;
  job.error = some_problem();
  return job;
}

}  // namespace isomesh::test
