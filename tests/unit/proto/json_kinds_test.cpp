// Tests of JSON members that only jobs by labels, or with a bounded or measured error, have.
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include "proto/json.h"
#include "tests/unit/proto/answers.h"

namespace isomesh {
namespace {

using nlohmann::json;
using test::succeeded_job;

TEST(JobJson, TellsOfLabelsOnlyWhereThereAreSome) {
  Job job = succeeded_job();
  const std::string by_iso = to_json(job);
  for (const char* member : {"labels", "background", "label_names"}) {
    EXPECT_EQ(by_iso.find(member), std::string::npos) << member;
  }
  static_cast<MeshParameters&>(job.parameters) = label_parameters({{3}});
  job.parameters.label_names = {{3, "Liver"}};
  job.parameters.label_values = {{3, {3, 9}}};
  job.mesh->labels = {
      {.label = 3,
       .name = "Liver",
       .color = "#112233",
       .voxels = 7,
       .voxels_mm3 = 3.5,
       .triangles = 40,
       .vertices = 22,
       .closed = true,
       .manifold = true,
       .oriented = true,
       .components = 1,
       .area_mm2 = 12.5,
       .volume_mm3 = 3.25,
       .files = {{MeshFormat::kStl, {.bytes = 9, .sha256 = "aa", .offset = 4, .href = "/x"}}}}};
  const std::string text = to_json(job);
  EXPECT_EQ(text.find("\"iso\""), std::string::npos);
  EXPECT_EQ(text.find("interpolation"), std::string::npos);
  Job read = job_from_json(text);
  read.parameters.interpolation = job.parameters.interpolation;
  EXPECT_EQ(read, job);
  read = job_from_record(text);
  read.parameters.interpolation = job.parameters.interpolation;
  EXPECT_EQ(read, job);
}

TEST(JobJson, TellsTheNumberOfManyLabelsOnly) {
  Job job = succeeded_job();
  static_cast<MeshParameters&>(job.parameters) = label_parameters({});
  for (std::int64_t label = 1; label <= 257; ++label) {
    job.mesh->labels.push_back({.label = label});
    job.parameters.label_names[label] = "x";
    if (label <= 256) job.parameters.label_colors[label] = "#112233";
  }
  EXPECT_EQ(job_from_record(to_record(job)).mesh->labels.size(), 257U);
  EXPECT_EQ(job_from_record(to_record(job)).parameters.label_names, job.parameters.label_names);
  Job told = job_from_json(to_json(job));
  EXPECT_TRUE(told.mesh->labels.empty());
  EXPECT_EQ(told.mesh->labels_count, 257U);
  EXPECT_TRUE(told.parameters.label_names.empty());
  EXPECT_EQ(told.parameters.label_colors, job.parameters.label_colors);

  job.mesh->labels.clear();
  job.mesh->labels_count = 257;
  job.mesh->label_list = {9, "aa"};
  job.mesh->walls_count = 700;
  job.mesh->wall_list = {24 * 700, "bb"};
  EXPECT_EQ(job_from_record(to_record(job)).mesh, job.mesh);
  told = job_from_json(to_json(job));
  EXPECT_EQ(told.mesh->labels_count, 257U);
  EXPECT_EQ(told.mesh->walls_count, 700U);
  EXPECT_FALSE(told.mesh->label_list);
  EXPECT_FALSE(told.mesh->wall_list);
}

// --- The error -----------------------------------------------------------------------------------

Job certified_job() {
  Job job = succeeded_job();
  job.parameters.max_error_mm = 0.1;
  job.parameters.triangles = 200000;
  job.parameters.lods = {1, 0.25};
  job.parameters.crop = Box{{{-1, -2, -3}, {4, 5, 6.5}}};
  job.parameters.fill_cavities = true;
  job.parameters.distances = true;
  job.parameters.components.nearest_to = {{1, 2, 3}, {4, 5, 6}};
  job.parameters.certify = true;
  job.parameters.min_thickness_mm = 0.4;
  job.parameters.untangle = true;
  job.timing.thickness = 3;
  job.timing.untangle = 12;
  MeshSummary& mesh = *job.mesh;
  mesh.iso = 61.5;
  mesh.empty = true;
  mesh.simplified = {.triangles_before = 7, .bound_by = Simplification::Bound::kTriangles};
  mesh.untangled = {.pairs = 4, .vertices = 9, .left = 1};
  mesh.quality.encloses_volume = true;
  mesh.quality.self_intersections = {.pairs = 3, .triangles = 5, .places = {{1, 2, 3}}};
  mesh.thickness = {.thinnest_mm = 0.3, .place = {{1, 2, 3}}, .thin_area_mm2 = 12};
  mesh.notes = {note_of(NoteCode::kThinWalls, "One cavity is open.")};
  mesh.certificate.emplace();
  mesh.certificate->reference = MeshCertificate::Reference::kSmoothed;
  mesh.certificate->file = MeshFormat::k3mf;
  mesh.certificate->found_mm = 0.09;
  mesh.certificate->bound_mm = 0.1;
  mesh.certificate->from_mesh = {
      .points = 9, .max_mm = 0.08, .mean_mm = 0.01, .rms_mm = 0.02, .p99_mm = 0.07};
  mesh.certificate->from_extracted.histogram.back() = 9;
  mesh.certificate->budget_mm = {.smoothing = 0.05, .quantisation = 0.01, .simplification = 0.04};
  return job;
}

TEST(JobJson, OfTheErrorComesBackTheSame) {
  EXPECT_EQ(job_from_json(to_json(certified_job())), certified_job());
}

// Answers of a server without the stage.
TEST(JobJson, MayLackTimesOfStagesThatAreNotAlwaysRun) {
  Job job = certified_job();
  json text = json::parse(to_json(job));
  EXPECT_EQ(text["timing"].erase("untangle"), 1U);
  job.timing.untangle = 0;
  EXPECT_EQ(job_from_json(text.dump()), job);
  text["timing"].erase("smooth");
  EXPECT_THROW(job_from_json(text.dump()), Error);
}

// Older servers measured each error from the extracted surface.
TEST(JobJson, MayLackTheReferenceOfTheError) {
  Job job = certified_job();
  json text = json::parse(to_json(job));
  EXPECT_EQ(text["mesh"]["certificate"]["reference"], "smoothed");
  EXPECT_EQ(text["mesh"]["certificate"].erase("reference"), 1U);
  job.mesh->certificate->reference = MeshCertificate::Reference::kExtracted;
  EXPECT_EQ(job_from_json(text.dump()), job);
}

TEST(JobJson, TellsOfTheErrorOnlyWhereThereIsSomething) {
  const json job = json::parse(to_json(succeeded_job()));
  for (const char* const name : {"max_error_mm", "triangles", "lods", "crop", "fill_cavities",
                                 "distances", "certify", "min_thickness_mm", "untangle"}) {
    EXPECT_FALSE(job["parameters"].contains(name)) << name;
  }
  EXPECT_FALSE(job["parameters"]["components"].contains("nearest_to"));
  for (const char* const name : {"iso", "untangled", "simplified", "certificate", "thickness"}) {
    EXPECT_FALSE(job["mesh"].contains(name)) << name;
  }
  EXPECT_FALSE(job["mesh"]["quality"].contains("self_intersections"));
}

}  // namespace
}  // namespace isomesh
