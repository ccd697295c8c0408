#include "client/cli/report.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "client/cli/text.h"
#include "proto/json.h"
#include "tests/unit/client/support.h"

namespace isomesh::cli {
namespace {

using testing::HasSubstr;
using testing::Not;

constexpr Timing kTiming = {
    .queue = 0.4, .load = 100, .extract = 250, .smooth = 1500, .encode = 149.6, .total = 2000};

TEST(TimingReport, AlignsStagesTimesAndShares) {
  EXPECT_EQ(timing_report(kTiming, {.upload = 12.34, .download = 3}),
            "  stage         time    share\n"
            "  upload     12.3 ms\n"
            "  queue       0.4 ms    0.0 %\n"
            "  load      100.0 ms    5.0 %\n"
            "  extract   250.0 ms   12.5 %\n"
            "  smooth      1.50 s   75.0 %\n"
            "  encode    149.6 ms    7.5 %\n"
            "  total       2.00 s  100.0 %\n"
            "  download    3.0 ms\n");
}

TEST(TimingReport, SaysNothingOfSharesOfNothing) {
  EXPECT_THAT(timing_report({}, {}), Not(HasSubstr("nan")));
  EXPECT_THAT(timing_report({}, {}), Not(HasSubstr("upload")));
}

TEST(MeshReport, NamesWhatTheMeshIs) {
  MeshSummary mesh;
  mesh.triangles = 1234567;
  mesh.vertices = 617283;
  mesh.euler = -4;
  mesh.area_mm2 = 123456.78;
  mesh.area_extracted_mm2 = 130000;
  mesh.displacement_mm = {.mean = 0.0512, .max = 1.25};
  mesh.volume_mm3 = {.extracted = 1000.04, .smoothed = 999.96};
  mesh.bounds = {{{-90, -126, -72}, {90, 90, 108}}};
  mesh.files[MeshFormat::kDrc].bytes = 3510351;
  mesh.dropped = {.components = 12, .triangles = 3456};
  mesh.quality = {.closed = true,
                  .manifold = true,
                  .oriented = true,
                  .components = 3,
                  .genus = 5,
                  .aspect_ratio = {{.mean = 0.6514}, {.mean = 0.8}},
                  .smallest_angle_deg = {{.mean = 30.04}, {.mean = 41.96}},
                  .encloses_volume = true};
  EXPECT_EQ(mesh_report(mesh),
            "  triangles       1,234,567\n"
            "  vertices        617,283\n"
            "  boundary edges  0\n"
            "  components      0\n"
            "  Euler number    -4\n"
            "  area            130,000.0 mm² extracted\n"
            "                  123,456.8 mm² smoothed\n"
            "  volume          1,000.0 mm³ extracted\n"
            "                  1,000.0 mm³ smoothed\n"
            "  displacement    0.051 mm on average, 1.250 mm at most\n"
            "  x (LPS)         -90.00 to 90.00 mm\n"
            "  y               -126.00 to 90.00 mm\n"
            "  z               -72.00 to 108.00 mm\n"
            "  dropped         12 components of 3,456 triangles\n"
            "  topology        closed, manifold, oriented, genus 5\n"
            "  aspect ratio    0.651 extracted, 0.800 smoothed\n"
            "  smallest angle  30.0° extracted, 42.0° smoothed, on average\n"
            "  mesh.drc        3.5 MB (3,510,351 B)\n");
}

TEST(MeshReport, TellsHowMuchIsThinAndTheThinnestWall) {
  MeshSummary mesh;
  mesh.area_mm2 = 1234;
  EXPECT_THAT(mesh_report(mesh), Not(HasSubstr("thinnest")));
  mesh.thickness = Thickness{.thinnest_mm = 0.25, .place = {{1, 2, -3}}, .thin_area_mm2 = 12.34};
  EXPECT_THAT(mesh_report(mesh), HasSubstr("thin walls      12.3 mm² of the surface, 1.0 %\n"
                                           "    thinnest      0.250 mm at 1.00, 2.00, -3.00 mm\n"));
  mesh.labels.resize(2);
  EXPECT_THAT(mesh_report(mesh), HasSubstr("12.3 mm² of the surface\n"));
  mesh.thickness = Thickness();
  EXPECT_THAT(mesh_report(mesh), HasSubstr("thin walls      none: "));
}

TEST(MeshReport, HasTheMeshsNotesWithOptions) {
  MeshSummary mesh;
  EXPECT_THAT(mesh_report(mesh), Not(HasSubstr("note")));
  mesh.notes = {note_of(NoteCode::kThinWalls, "1 cavity is open. scheme=5 closes it.")};
  EXPECT_THAT(mesh_report(mesh),
              HasSubstr("note            1 cavity is open. --scheme 5 closes it. "
                        "(thin-walls)\n"));
}

TEST(MeshReport, SaysThatAnOpenSurfaceEnclosesNothing) {
  MeshSummary mesh;
  mesh.triangles = 7;
  mesh.volume_mm3 = {.extracted = 1234.5, .smoothed = 1234.5};
  const std::string report = mesh_report(mesh);
  EXPECT_THAT(report, HasSubstr("volume          none: the surface is open; --close"));
  EXPECT_THAT(report, Not(HasSubstr("1,234.5")));
  mesh.quality.closed = true;
  EXPECT_THAT(
      mesh_report(mesh),
      HasSubstr("volume          none: the triangles disagree about which side is outside"));
}

TEST(MeshReport, OffersTheOtherSideOfASurfaceThatIsInsideOut) {
  MeshSummary mesh;
  mesh.iso = 0;
  mesh.triangles = 7;
  mesh.volume_mm3 = {.extracted = -2117.3, .smoothed = -2117.3};
  mesh.quality.closed = mesh.quality.oriented = true;
  const std::string report = mesh_report(mesh);
  EXPECT_THAT(report, HasSubstr("volume          none: the surface is inside out; "));
  EXPECT_THAT(report, HasSubstr("--inside below"));
  EXPECT_THAT(report, Not(HasSubstr("2,117")));
  EXPECT_THAT(mesh_report(mesh, length_unit({}), Inside::kBelow), HasSubstr("--inside above"));
  mesh.iso.reset();
  EXPECT_THAT(mesh_report(mesh), HasSubstr("volume          none: the surface is inside out\n"));
}

TEST(MeshReport, SaysThatALabelThatIsInsideOutEnclosesNothing) {
  MeshSummary mesh;
  mesh.quality.oriented = true;
  mesh.labels = {{.label = 1, .closed = true, .oriented = true, .volume_mm3 = -27}};
  const std::string report = mesh_report(mesh);
  EXPECT_THAT(report, HasSubstr(" none "));
  EXPECT_THAT(report, Not(HasSubstr("-27")));
  EXPECT_THAT(report, HasSubstr("A closed label without a volume is inside out: "));
  EXPECT_THAT(report, Not(HasSubstr("--inside")));
  EXPECT_THAT(report, Not(HasSubstr("not oriented")));
}

TEST(MeshReport, SaysThatALabelThatIsNotOrientedEnclosesNothing) {
  MeshSummary mesh;
  mesh.labels = {{.label = 1, .closed = true, .oriented = false, .volume_mm3 = 27}};
  const std::string report = mesh_report(mesh);
  EXPECT_THAT(report, HasSubstr(" none "));
  EXPECT_THAT(report, Not(HasSubstr("open label")));
  EXPECT_THAT(report, HasSubstr("A label that is not oriented encloses no volume: "));
}

// The sum over the triangles of an open surface may even be negative.
TEST(MeshReport, SaysThatAnOpenLabelEnclosesNothing) {
  MeshSummary mesh;
  mesh.labels = {{.label = 1, .closed = true, .oriented = true, .volume_mm3 = 27}};
  EXPECT_THAT(mesh_report(mesh), Not(HasSubstr("open label")));
  mesh.labels.push_back({.label = 2, .closed = false, .oriented = true, .volume_mm3 = -823});
  const std::string report = mesh_report(mesh);
  EXPECT_THAT(report, HasSubstr(" 27.0 "));
  EXPECT_THAT(report, HasSubstr(" none "));
  EXPECT_THAT(report, Not(HasSubstr("823")));
  EXPECT_THAT(report, HasSubstr("An open label encloses no volume: it touches the volume's border. "
                                "--close caps it there.\n"));
}

TEST(MeshReport, IsInTheUnitOfTheVolume) {
  MeshSummary mesh;
  mesh.area_extracted_mm2 = 12;
  mesh.volume_mm3 = {.extracted = 5, .smoothed = 4};
  mesh.quality.encloses_volume = true;
  mesh.certificate.emplace().found_mm = 0.5;
  mesh.labels = {{.label = 1}};
  const std::vector<Note> notes = {note_of(NoteCode::kUnitAngstrom, "")};
  const std::string report = mesh_report(mesh, length_unit(notes));
  EXPECT_THAT(report, HasSubstr("12.0 angstrom² extracted\n"));
  EXPECT_THAT(report, HasSubstr("4.0 angstrom³ smoothed\n"));
  EXPECT_THAT(report, HasSubstr("0.5000 angstrom from the extracted surface"));
  EXPECT_THAT(report, HasSubstr("0.00 to 0.00 angstrom\n"));
  EXPECT_THAT(report, HasSubstr("angstrom³ of voxels"));
  EXPECT_THAT(report, Not(HasSubstr("mm")));
  Volume volume;
  volume.notes = notes;
  EXPECT_THAT(volume_report(volume), HasSubstr(" angstrom (LPS)"));
  EXPECT_THAT(volume_report(volume), Not(HasSubstr(" mm")));
}

TEST(MeshReport, TellsTheIsoValueAndTheError) {
  MeshSummary mesh;
  mesh.iso = 61.5;
  mesh.simplified = {.triangles_before = 5000, .bound_by = Simplification::Bound::kTriangles};
  mesh.certificate.emplace();
  mesh.certificate->file = MeshFormat::kStl;
  mesh.certificate->found_mm = 0.09876;
  mesh.certificate->from_mesh = {.max_mm = 0.05, .mean_mm = 0.01, .p99_mm = 0.04};
  mesh.certificate->from_extracted = {.max_mm = 0.09876, .mean_mm = 0.02, .p99_mm = 0.03};
  mesh.certificate->budget_mm = {.smoothing = 0.05, .quantisation = 0.01, .simplification = 0.04};
  mesh.quality.self_intersections = {.pairs = 3, .triangles = 5, .places = {{1, -2.5, 30}}};
  mesh.untangled = {.pairs = 1200, .vertices = 3400, .left = 1};
  const std::string report = mesh_report(mesh);
  EXPECT_THAT(report, HasSubstr("iso-value           61.5\n"));
  EXPECT_THAT(report, HasSubstr("from 5,000 triangles, bound by the number of triangles\n"));
  EXPECT_THAT(report,
              HasSubstr("0.0988 mm from the extracted surface, measured on the stl file\n"));
  EXPECT_THAT(report, HasSubstr("to the file       0.0988 mm at most, 0.0300 mm for 99 %"));
  EXPECT_THAT(report, HasSubstr("0.0500 mm smoothing, 0.0400 mm simplification, 0.0100 mm"));
  EXPECT_THAT(report,
              HasSubstr("self-intersections  3 pairs of triangles, the first at 1.00, -2.50, "
                        "30.00 mm\n"));
  EXPECT_THAT(report,
              HasSubstr("untangled           1,200 pairs of triangles; 3,400 vertices moved "
                        "back\n                      1 pair of triangles intersect as "
                        "extracted\n"));
  mesh.certificate->bound_mm = 0.1;
  mesh.certificate->reference = MeshCertificate::Reference::kSmoothed;
  EXPECT_THAT(mesh_report(mesh), HasSubstr("no point of any file or of the smoothed surface is "));
  EXPECT_THAT(mesh_report(mesh), HasSubstr("0.0988 mm from the smoothed surface, measured on"));
  mesh.simplified->bound_by = Simplification::Bound::kTopology;
  EXPECT_THAT(mesh_report(mesh), HasSubstr("bound by the topology: fewer triangles would open"));
}

TEST(VolumeReport, NamesWhatTheVolumeIs) {
  Volume volume;
  volume.id = "abc";
  volume.format = "nifti";
  volume.dims = {181, 217, 181};
  volume.bytes = 7109137;
  volume.range = {0, 254.5};
  EXPECT_THAT(volume_report(volume), HasSubstr("181 x 217 x 181 uint8, 7.1 MB"));
  EXPECT_THAT(volume_report(volume), HasSubstr("0 to 254.5"));
  EXPECT_THAT(volume_list({volume}), HasSubstr("  abc     nifti   181 x 217 x 181  uint8  7.1 MB"));
  EXPECT_THAT(volume_report(volume), Not(HasSubstr("modality")));
}

TEST(VolumeReport, NamesWhatDicomTells) {
  Volume volume;
  volume.modality = "CT";
  volume.presets = {{"bone", 250}};
  volume.ignored = {{"DICOMDIR", "it is a directory of DICOM files"}};
  volume.dicom.emplace().patient_name = "Doe^John";
  const std::string report = volume_report(volume);
  EXPECT_THAT(report, HasSubstr("modality          CT"));
  EXPECT_THAT(report, HasSubstr("iso of bone       250"));
  EXPECT_THAT(report, HasSubstr("ignored           DICOMDIR: it is a directory of DICOM files"));
  EXPECT_THAT(report, Not(HasSubstr("Doe")));  // a terminal may be anybody's
}

TEST(LabelList, IsATable) {
  EXPECT_EQ(label_list({.volume = "abc",
                        .labels = {{.label = -1, .voxels = 12'345, .volume_mm3 = 1.25},
                                   {.label = 7,
                                    .voxels = 1,
                                    .volume_mm3 = 2000,
                                    .name = "liver",
                                    .color = "#ff8000"}}}),
            "  label  voxels      mm3  color    name\n"
            "     -1  12,345      1.2\n"
            "      7       1  2,000.0  #ff8000  liver\n");
}

TEST(WallList, IsATable) {
  EXPECT_EQ(
      wall_list(
          {{.a = 3, .area_mm2 = 1234.56, .a_name = "liver"},
           {.a = 3, .b = 12, .area_mm2 = 7, .faces = 1234, .a_name = "liver", .b_name = "gut"}},
          {"mm", "millimetres", 1e-3}),
      "  label  name   label  name            mm²  faces\n"
      "      3  liver         background  1,234.6\n"
      "      3  liver     12  gut             7.0  1,234\n");
}

TEST(JobReport, TellsAJobThatRunsFromOneThatFailed) {
  Job job = test::finished_job("7", "mesh");
  job.state = JobState::kRunning;
  job.stage = Stage::kSmooth;
  job.progress = 0.62;
  job.mesh.reset();
  EXPECT_THAT(job_report(job), HasSubstr("smooth, 62 %"));
  EXPECT_THAT(job_report(job), Not(HasSubstr("total")));

  job.state = JobState::kFailed;
  job.error.emplace().detail = "the mesh has too many triangles";
  EXPECT_THAT(job_report(job), HasSubstr("the mesh has too many triangles"));
  EXPECT_THAT(job_list({job}), HasSubstr("failed"));
}

TEST(JobReport, TellsAMeshThatWasThereAlready) {
  Job job = test::finished_job("7", "mesh");
  EXPECT_THAT(job_report(job), Not(HasSubstr("earlier job")));
  job.reused = true;
  EXPECT_THAT(job_report(job), HasSubstr("earlier job"));
}

TEST(JobList, NamesTheVolumes) {
  Job named = test::finished_job("7", "mesh");
  Job nameless = test::finished_job("8", "mesh");
  nameless.parameters.volume = "0123456789abcdef";
  const std::string list = job_list({named, nameless}, {{"abc", "CT of the knee"}});
  EXPECT_THAT(list, HasSubstr("volume\n"));
  EXPECT_THAT(list, HasSubstr("  CT of the knee\n"));
  EXPECT_THAT(list, HasSubstr("  0123456789ab\n"));
}

TEST(WithOptions, NamesTheOptionInsteadOfTheParameter) {
  EXPECT_EQ(with_options("It has labels: mesh it with \"labels\": \"all\"."),
            "It has labels: mesh it with --labels all.");
  EXPECT_EQ(with_options("Choose one with member=NAME: \"member=NAME.nii\"."),
            "Choose one with --member NAME: \"member=NAME.nii\".");
  EXPECT_EQ(with_options("If it holds raw samples, give their dims (X,Y,Z) and type."),
            "If it holds raw samples, give their --dims X,Y,Z and --type.");
  EXPECT_EQ(with_options("no boundary in the box of crop; close adds the border"),
            "no boundary in the box of --crop; --close adds the border");
  EXPECT_EQ(with_options("smoothing=taubin keeps it; regularize=false changes less."),
            "--smoothing taubin keeps it; --no-regularize changes less.");
  EXPECT_EQ(with_options("as it is"), "as it is");
}

TEST(JobJson, AddsWhatTheClientKnows) {
  const Job job = test::finished_job("7", "mesh");
  const std::string text = job_json(job, {"out/a.drc", "b\".drc"}, {.upload = 12.5});
  EXPECT_EQ(job_from_json(text), job);
  EXPECT_THAT(text, HasSubstr(R"("outputs":["out/a.drc","b\".drc"])"));
  EXPECT_THAT(text, HasSubstr(R"("client":{"upload":12.5})"));
}

}  // namespace
}  // namespace isomesh::cli
