// Tests of notes about how a volume was read, and of the options that errors offer, from file to
// mesh.
#include <algorithm>
#include <cmath>
#include <map>
#include <numeric>
#include <string>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "proto/json.h"
#include "server/import/dicom/elements/tags.h"
#include "tests/api/daemon.h"
#include "tests/support/deflate.h"
#include "tests/unit/import/dicom/mosaics.h"
#include "tests/unit/import/dicom/segments.h"
#include "tests/unit/import/dicom/structures.h"
#include "tests/unit/import/writers.h"

namespace isomesh::test {
namespace {

using import::test::box;
using import::test::DicomSeries;
using import::test::nifti;
using import::test::segmentation;
using import::test::siemens_mosaic;
using testing::AllOf;
using testing::Contains;
using testing::ElementsAre;
using testing::EndsWith;
using testing::Field;
using testing::HasSubstr;
using testing::IsEmpty;
using testing::Not;
using testing::StartsWith;

const std::string kSamples = "abcdefghijklmnopqrstuvwx";  // 4 x 3 x 2

// --- Files that show a note each -----------------------------------------------------------------

// Without a spacing a header gets a note.
const std::string kSpaced = "space: LPS\nspace directions: (1,0,0) (0,1,0) (0,0,1)\n";

std::string nrrd(const std::string& fields, const std::string& samples = kSamples) {
  return "NRRD0004\ntype: uint8\ndimension: 3\nsizes: 4 3 2\nencoding: raw\n" + fields + '\n' +
         samples;
}

std::string metaimage(const std::string& fields, const std::string& samples = kSamples) {
  return "ObjectType = Image\nNDims = 3\nDimSize = 4 3 2\nElementType = MET_UCHAR\n" + fields +
         "ElementDataFile = LOCAL\n" + samples;
}

// Two volumes.
std::string two_times() { return nifti({.dim = {4, 2, 3, 2, 2, 1, 1, 1}}, kSamples); }

std::string not_finite() {
  std::vector<float> samples(24);
  std::iota(samples.begin(), samples.end(), 0.0F);
  samples[5] = std::nanf("");
  return nifti({.datatype = 16, .bitpix = 32}, import::test::bytes_of(samples));
}

// A label of 2^40 in half of 2 x 2 x 2 samples.
std::string wide_labels() {
  const std::string background(32, '\0');
  std::string label;
  for (int n = 0; n < 4; ++n) label += std::string("\0\0\0\0\0\1\0\0", 8);
  return "NRRD0004\ntype: uint64\ndimension: 3\nsizes: 2 2 2\nencoding: raw\nendian: little\n" +
         kSpaced + '\n' + background + label;
}

// A CT of 4 x 4 samples, 1 mm apart.
const DicomSeries kCt = {.columns = 4,
                         .rows = 4,
                         .slices = 4,
                         .origin = {0, 0, 0},
                         .step = {0, 0, 1},
                         .between_rows = 1,
                         .between_columns = 1};

import::test::DicomObject slice_object(std::uint32_t number){return kCt.slice(number);
}  // namespace

// A slice whose first sample is padding.
std::string padded_slice(std::uint32_t number) {
  return kCt.slice(number)
      .number(import::dicom::kPixelPaddingValue, static_cast<unsigned>(kCt.stored(0, 0, number)))
      .file();
}

std::string slice(std::uint32_t number, const std::string& frame_of_reference) {
  return slice_object(number)
      .text(import::dicom::kFrameOfReferenceUid, "UI", frame_of_reference)
      .file();
}

std::string slice_at(std::uint32_t number, const std::string& position) {
  return slice_object(number).text(import::dicom::kImagePosition, "DS", position).file();
}

std::string skewed_slice(std::uint32_t number) {
  return slice_object(number)
      .text(import::dicom::kImageOrientation, "DS", "1\\0\\0\\0.005\\0.9999875\\0")
      .file();
}

// A label map with a frame at 0, 1 and 3 mm.
std::string sparse_segmentation() {
  return segmentation(
             {.frames = {{.z = 0, .labels = {2}}, {.z = 1, .labels = {3}}, {.z = 3, .labels = {3}}},
              .type = "LABELMAP"})
      .file();
}

// One segment in two planes.
std::string fractional_segmentation() {
  return segmentation({.frames = {{.z = 0, .segment = 1, .labels = {2}, .value = 255},
                                  {.z = 1, .segment = 1, .labels = {3}, .value = 255}},
                       .segments = {"liver"},
                       .type = "FRACTIONAL",
                       .maximum = 255})
      .file();
}

// Slices in tiles, with a thickness and no distance.
std::string mosaic() {
  return siemens_mosaic()
      .erase(import::dicom::kSpacingBetweenSlices)
      .text(import::dicom::kSliceThickness, "DS", "3")
      .file();
}

// A structure with a square in the first and last slice of a series, and a point.
std::string structure_set() {
  return import::test::structure_set({{.number = 5,
                                       .name = "heart",
                                       .contours = {{box(0.5, 0.5, 2.5, 2.5, 0)},
                                                    {box(0.5, 0.5, 2.5, 2.5, 3)},
                                                    {{{1, 1, 1}}, "POINT"}}}})
      .file();
}

using Files = std::map<std::string, std::string>;

Files structures_and_images() {
  Files files = {{"RS", structure_set()}};
  for (std::uint32_t number = 0; number < 4; ++number) {
    files["CT" + std::to_string(number)] = slice(number, "1.2.3.frame");
  }
  return files;
}

struct Shown {
  Files files;
  std::vector<std::string> options = {};
  std::string axes = {};  // of a change of the orientation after the upload
};

std::string nearly_whole() {
  std::vector<float> labels(24, 0);
  for (std::size_t at = 8; at < 16; ++at) labels[at] = 0.9999F;
  for (std::size_t at = 16; at < 24; ++at) labels[at] = 2;
  return nifti({.datatype = 16, .bitpix = 32}, import::test::bytes_of(labels));
}

// Two chunks, the second of which is missing.
Files sparse_zarr() {
  return {
      {".zattrs", R"({"multiscales": [{"axes": ["z", "y", "x"], "datasets": [{"path": "0"}]}]})"},
      {"0/.zarray", R"({"zarr_format": 2, "shape": [2, 3, 4], "chunks": [1, 3, 4], "dtype": "|u1",)"
                    R"( "order": "C", "fill_value": 0, "compressor": null})"},
      {"0/0.0.0", kSamples.substr(0, 12)}};
}

// By the note's name, so that whoever adds a note adds how it is shown.
const std::map<std::string, Shown>& shown() {
  static const std::map<std::string, Shown> all = {
      {"forms-differ", {{{"a.nii", nifti({.qform_code = 1, .qoffset = {3, 0, 0}}, kSamples)}}}},
      {"pixdim-differs", {{{"a.nii", nifti({.pixdim = {1, 2, 2, 2, 1, 1, 1, 1}}, kSamples)}}}},
      {"volume-chosen", {{{"a.nii", two_times()}}, {"--volume", "1"}}},
      {"space-assumed", {{{"a.nrrd", nrrd("")}}}},
      {"frames-as-slices",
       {{{"a.nrrd", nrrd("kinds: domain domain time\n")}}, {"--accept", "frames-as-slices"}}},
      {"header-corrected", {{{"a.nii", nifti({.bitpix = 16}, kSamples)}}}},
      {"rescale-ignored", {{{"a.nii", nifti({.intercept = 5}, kSamples)}}}},
      {"labels-rounded", {{{"a.nii", nearly_whole()}}}},
      {"unit-unknown",
       {{{"a.nrrd",
          nrrd("space: LPS\nspace directions: (1,0,0) (0,1,0) (0,0,1)\nspace units: \"pixel\" "
               "\"pixel\" \"pixel\"\n")}}}},
      {"unit-angstrom",
       {{{"a.cube", "title\n\n1 0 0 0\n2 1 0 0\n2 0 1 0\n2 0 0 1\n6 6 0 0 0\n1 2 3 4 5 6 7 8\n"}}}},
      {"non-finite-samples", {{{"a.nii", not_finite()}}}},
      {"trailing-bytes", {{{"a.nrrd", nrrd("", kSamples + "more")}}}},
      {"values-rescaled", {{{"a.mha", metaimage("ElementToIntensityFunctionSlope = 2\n")}}}},
      {"duplicate-file",
       {{{"1", slice(1, "1.9")}, {"2", slice(2, "1.9")}, {"again", slice(2, "1.9")}}}},
      {"looks-like-labels",
       {{{"a.nrrd",
          nrrd("", std::string(8, '\0') + std::string(8, '\1') + std::string(8, '\5'))}}}},
      {"labels-renumbered", {{{"a.nrrd", wide_labels()}}}},
      {"overlapping-segments",
       {{{"a.seg.nrrd",
          "NRRD0004\ntype: uint8\ndimension: 4\nsizes: 2 2 2 2\nkinds: list domain domain "
          "domain\nencoding: raw\nspace: LPS\nspace directions: none (1,0,0) (0,1,0) "
          "(0,0,1)\nSegment0_Layer:=0\nSegment1_Layer:=1\n\n" +
              std::string(16, '\1')}}}},
      {"fractional-segments", {{{"a.dcm", fractional_segmentation()}}}},
      {"contours-skipped", {structures_and_images(), {"--series", "1.2.9"}}},
      {"contours-interpolated", {structures_and_images(), {"--series", "1.2.9"}}},
      {"chunks-missing", {sparse_zarr()}},
      {"empty-planes", {{{"a.dcm", sparse_segmentation()}}}},
      {"padding", {{{"1", padded_slice(1)}, {"2", padded_slice(2)}}}},
      {"distance-assumed", {{{"a.dcm", mosaic()}}}},
      {"duplicate-slice",
       {{{"0", slice_object(0).file()},
         {"1", slice_object(1).file()},
         {"again", slice_object(1).text(import::dicom::kContentTime, "TM", "12").file()}}}},
      {"directions-corrected", {{{"0", skewed_slice(0)}, {"1", skewed_slice(1)}}}},
      {"positions-rounded",
       {{{"0", slice_at(0, "0\\0\\0")},
         {"1", slice_at(1, "0\\0\\1.2")},
         {"2", slice_at(2, "0\\0\\2.5")},
         {"3", slice_at(3, "0\\0\\3.8")}}}},
      {"orientation-changed", {{{"a.nrrd", nrrd("")}}, {}, "y,-x,z"}},
      {"frame-of-reference",
       {{{"1", slice(1, "1.9.1")}, {"2", slice(2, "1.9.2")}, {"3", slice(3, "1.9.3")}}}},
  };
  return all;
}

class NotesTest : public testing::Test {
 protected:
  // Uploads the files with the command, as a folder where there are several.
  Finished upload_files(const Shown& what, const std::string& folder) {
    std::filesystem::create_directories(folder_ / folder);
    for (const auto& [name, bytes] : what.files) {
      std::filesystem::create_directories((folder_ / folder / name).parent_path());
      write_file(folder_ / folder / name, bytes);
    }
    const auto path = folder_ / folder;
    const Finished uploaded = daemon_.command(
        with({"--json", "upload", what.files.size() == 1 ? path / what.files.begin()->first : path},
             what.options));
    if (what.axes.empty()) return uploaded;
    const std::string id = volume_from_json(uploaded.output).id;
    return daemon_.command({"--json", "reorient", id, "--axes=" + what.axes});
  }

  const Daemon daemon_;
  const TemporaryFolder folder_;
};

TEST_F(NotesTest, EveryCodeIsShownByAFileAndCarriedToTheEnd) {
  for (const NoteDescription& note : note_descriptions()) {
    if (note.is_of_mesh) continue;
    const std::string code(note.name);
    SCOPED_TRACE(code);
    const auto found = shown().find(code);
    ASSERT_NE(found, shown().end()) << "no file shows this note: add one to shown()";
    const Finished uploaded = upload_files(found->second, code);
    ASSERT_EQ(uploaded.status, 0) << uploaded.errors;
    EXPECT_THAT(uploaded.errors, HasSubstr('(' + code + ')'));
    const Volume volume = volume_from_json(uploaded.output);
    EXPECT_THAT(volume.notes, Contains(Field(&Note::code, code)));
    EXPECT_EQ(daemon_.client().volume(volume.id).notes, volume.notes);
    EXPECT_THAT(daemon_.command({"info", volume.id}).output, HasSubstr('(' + code + ')'));
    const auto mesh = folder_ / (code + ".glb");
    const Finished meshed =
        daemon_.command({"submit", volume.id, "--iso", "otsu", "--format", "glb"});
    ASSERT_EQ(meshed.status, 0) << meshed.errors;
    const std::string job = meshed.line();
    ASSERT_EQ(daemon_.client().wait(job).state, JobState::kSucceeded);
    daemon_.client().fetch(job, MeshFormat::kGlb, mesh);
    const std::string in_mesh = "{\"code\":\"" + code + "\"";
    EXPECT_EQ(read_file(mesh).find(in_mesh) != std::string::npos, note.is_in_mesh);
  }
}

TEST_F(NotesTest, OfAMeshAreShownWithIt) {
  // A hollow ball whose wall is one and a half voxels.
  constexpr int kSize = 30;
  std::string samples;
  for (int n = 0; n < kSize * kSize * kSize; ++n) {
    const double r =
        std::hypot(n % kSize - 14.6, n / kSize % kSize - 14.3, n / kSize / kSize - 14.8);
    samples += static_cast<char>(std::abs(r - 11) < 0.75 ? 1 : 0);
  }
  write_file(folder_ / "ball.nrrd",
             "NRRD0004\ntype: uint8\ndimension: 3\nspace: LPS\nsizes: 30 30 30\n"
             "space directions: (1,0,0) (0,1,0) (0,0,1)\nspace origin: (0,0,0)\nencoding: raw\n\n" +
                 samples);
  const auto mesh = [&](const std::string& scheme) {
    return daemon_.command({"mesh", folder_ / "ball.nrrd", "--iso", "0.5", "--scheme", scheme,
                            "--fill-cavities", "-o", folder_ / "ball.stl"});
  };
  const Finished open = mesh("6");
  ASSERT_EQ(open.status, 0) << open.errors;
  EXPECT_THAT(open.output, HasSubstr("not filled"));
  EXPECT_THAT(open.output, HasSubstr("--scheme 5 closes it. (thin-walls)"));
  const Finished closed = mesh("5");
  ASSERT_EQ(closed.status, 0) << closed.errors;
  EXPECT_THAT(closed.output, Not(HasSubstr("thin-walls")));
  const std::string query = "/v1/mesh?format=stl&iso=0.5&fill_cavities=true&scheme=";
  for (const std::string scheme : {"6", "5"}) {
    const Answer answer = daemon_.send("POST", query + scheme, read_file(folder_ / "ball.nrrd"));
    const std::string codes = answer.header("isomesh-notes");
    EXPECT_EQ(codes.find("thin-walls") != std::string::npos, scheme == "6") << codes;
  }
}

// The codes are in a header of one length at most, and the volume has their texts.
TEST_F(NotesTest, AreToldWithTheMeshOfOneRequest) {
  const std::string file = nifti({.qform_code = 1, .qoffset = {3, 0, 0}}, kSamples);
  for (const std::string query : {"iso=110", "iso=1000", "iso=1000&allow_empty=true"}) {
    SCOPED_TRACE(query);
    const Answer answer = daemon_.send("POST", "/v1/mesh?format=stl&" + query, file);
    EXPECT_THAT(answer.header("isomesh-notes"), HasSubstr("forms-differ"));
    const std::string link = answer.header("link");
    ASSERT_THAT(link, AllOf(StartsWith("</v1/volumes/"), EndsWith(">; rel=\"describedby\"")));
    const Answer volume = daemon_.get(link.substr(1, link.find('>') - 1));
    std::string codes;
    for (const Note& note : volume_from_json(volume.body).notes) {
      codes += (codes.empty() ? "" : ", ") + note.code;
    }
    EXPECT_EQ(answer.header("isomesh-notes"), codes);
  }
  const RawUpload sphere = sphere_upload();
  const Answer plain =
      daemon_.send("POST", "/v1/mesh?iso=100&passes=0&" + sphere.query, sphere.bytes);
  EXPECT_EQ(plain.headers.count("isomesh-notes"), 0U);
  EXPECT_EQ(plain.headers.count("link"), 1U);
  std::size_t longest = 0;
  for (const NoteDescription& note : note_descriptions()) longest += note.name.size() + 2;
  EXPECT_LT(longest, 2048U);
}

TEST_F(NotesTest, ARefusalOffersTheVolumesOfAFile) {
  const std::string file = two_times();
  const Answer open = daemon_.send("POST", "/v1/volumes", file);
  EXPECT_EQ(open.status, 422);
  const std::vector<Choice> choices = problem_from_json(open.body).remedy.choices;
  EXPECT_THAT(choices, ElementsAre(testing::Field(&Choice::title, "time 0"),
                                   testing::Field(&Choice::title, "time 1")));
  for (const Choice& choice : choices) {
    EXPECT_EQ(choice.parameter, "volume");
    EXPECT_TRUE(choice.picture) << choice.value;
  }
  EXPECT_EQ(daemon_.send("POST", "/v1/volumes?volume=1", file).status, 201);
  EXPECT_EQ(daemon_.send("POST", "/v1/mesh?volume=1&iso=110&format=stl", file).status, 200);
  EXPECT_EQ(daemon_.send("POST", "/v1/mesh?iso=110&format=stl", file).status, 422);
  write_file(folder_ / "a.nii", file);
  const Finished said = daemon_.command({"upload", folder_ / "a.nii"});
  EXPECT_EQ(said.status, 1);
  EXPECT_THAT(said.errors, HasSubstr("--volume 1"));
}

TEST_F(NotesTest, AStructureSetAloneNeedsASpacing) {
  const Answer open = daemon_.send("POST", "/v1/volumes", structure_set());
  EXPECT_EQ(open.status, 422);
  EXPECT_THAT(open.body, HasSubstr("spacing=X,Y,Z"));
  const Answer drawn = daemon_.send("POST", "/v1/volumes?spacing=1,1,1", structure_set());
  ASSERT_EQ(drawn.status, 201) << drawn.body;
  const Volume volume = volume_from_json(drawn.body);
  EXPECT_EQ(volume.geometry.spacing, (std::array<double, 3>{1, 1, 1}));
  const Answer labels = daemon_.send("GET", "/v1/volumes/" + volume.id + "/labels");
  EXPECT_THAT(labels.body, AllOf(HasSubstr("heart"), HasSubstr("#ff0000")));
  EXPECT_EQ(daemon_.send("POST", "/v1/volumes?spacing=0,1,1", structure_set()).status, 400);
}

TEST_F(NotesTest, EveryVolumeOfAFolderIsAnsweredFor) {
  const Shown several = {
      {{"a.nrrd", nrrd("")},
       {"b.nii.gz", gzip(nifti({.qform_code = 1, .qoffset = {3, 0, 0}}, kSamples))},
       {"broken.nrrd", nrrd("", "few")},
       {"readme", "text"}}};
  const Finished uploaded = upload_files(several, "several");
  EXPECT_EQ(uploaded.status, 1);
  EXPECT_THAT(uploaded.errors, HasSubstr("broken.nrrd: The file is truncated"));
  const std::vector<UploadedVolume> volumes = uploaded_volumes_from_json(uploaded.output);
  ASSERT_EQ(volumes.size(), 3U);
  EXPECT_EQ(volumes[0].volume->name, "a.nrrd");
  EXPECT_EQ(volumes[1].status, 201);
  EXPECT_THAT(volumes[1].volume->notes, Contains(Field(&Note::code, "forms-differ")));
  EXPECT_EQ(volumes[2].status, 422);
  EXPECT_EQ(daemon_.client().volumes().size(), 2U);
  const Finished meshed =
      daemon_.command({"mesh", folder_ / "several", "--iso", "110", "-o", folder_ / "a.stl"});
  EXPECT_EQ(meshed.status, 1);
  EXPECT_THAT(meshed.errors, HasSubstr("--member a.nrrd"));
  EXPECT_EQ(daemon_
                .command({"mesh", folder_ / "several", "--member", "a.nrrd", "--iso", "110", "-o",
                          folder_ / "a.stl"})
                .status,
            0);
}

TEST_F(NotesTest, AVolumeThatItsFilePlacesWronglyIsFlippedAndTurned) {
  const Volume head = volume_from_json(upload_files({{{"a.nrrd", nrrd("")}}}, "head").output);
  const std::string path = "/v1/volumes/" + head.id + "/reoriented";
  for (const std::string axes : {"", "?axes=", "?axes=x,y,z", "?axes=x,y", "?axes=x,x,y"}) {
    EXPECT_EQ(daemon_.send("POST", path + axes).status, 400) << axes;
  }
  EXPECT_EQ(head.stored_axes, "LPS");
  const Volume flipped = daemon_.client().reorient_volume(head.id, "-x,y,z");
  EXPECT_EQ(flipped.stored_axes, "RPS");
  // It is flipped about its centre, and its axes have the order of the patient again.
  EXPECT_EQ(flipped.geometry, head.geometry);
  EXPECT_EQ(daemon_.send("POST", path + "?axes=-x,y,z").status, 200);
  EXPECT_EQ(daemon_.client().reorient_volume(flipped.id, "-x,y,z").id, head.id);
  const Volume turned = daemon_.client().reorient_volume(flipped.id, "y,x,z");
  EXPECT_THAT(turned.notes.back().detail, EndsWith("gives to -y,x,z."));
  EXPECT_EQ(turned.geometry.direction, head.geometry.direction);
  EXPECT_EQ(daemon_.send("POST", path + "?axes=-y,x,z").status, 200);
  // The samples of each row are in the opposite order.
  const auto slice = [&](const std::string& id) {
    return daemon_.send("GET", "/v1/volumes/" + id + "/slice").body;
  };
  std::string rows = slice(head.id);
  for (auto row = rows.begin(); row != rows.end(); row += head.dims[0]) {
    std::reverse(row, row + head.dims[0]);
  }
  EXPECT_EQ(slice(flipped.id), rows);
}

TEST_F(NotesTest, AFlippedDicomVolumeKeepsItsPatientButNotItsFrame) {
  const Volume ct = volume_from_json(
      upload_files({{{"1", slice(1, "1.9")}, {"2", slice(2, "1.9")}}}, "ct").output);
  ASSERT_TRUE(ct.dicom);
  EXPECT_EQ(ct.dicom->frame_of_reference_uid, "1.9");
  const Volume flipped = daemon_.client().reorient_volume(ct.id, "x,y,-z");
  ASSERT_TRUE(flipped.dicom);
  EXPECT_EQ(flipped.dicom->study_uid, ct.dicom->study_uid);
  EXPECT_EQ(flipped.dicom->frame_of_reference_uid, "");
  EXPECT_TRUE(flipped.dicom->instances.empty());
  EXPECT_FALSE(ct.dicom->instances.empty());
}

TEST_F(NotesTest, AVolumeKeepsItsFilesNameUntilItIsRenamed) {
  write_file(folder_ / "M\xC3\xBCller ct.nrrd", nrrd(""));
  const Finished uploaded = daemon_.command({"upload", folder_ / "M\xC3\xBCller ct.nrrd"});
  const std::string id = uploaded.output.substr(0, 64);
  EXPECT_EQ(daemon_.client().volume(id).name, "M\xC3\xBCller ct.nrrd");
  EXPECT_EQ(daemon_.client().rename_volume(id, "head").name, "head");
  EXPECT_EQ(daemon_.command({"rename", id, "skull"}).status, 0);
  EXPECT_EQ(daemon_.client().volume(id).name, "skull");
  EXPECT_EQ(daemon_.client().rename_volume(id, std::nullopt).name, std::nullopt);
  const Headers json = {{"Content-Type", "application/json"}};
  for (const std::string body : {"", "[]", "{}", "{\"name\":5}", "{\"name\":\"\"}",
                                 "{\"name\":\"a\\nb\"}", "{\"name\":\"a\",\"id\":\"b\"}"}) {
    EXPECT_EQ(daemon_.send("PATCH", "/v1/volumes/" + id, body, json).status, 400) << body;
  }
  EXPECT_EQ(
      daemon_.send("PATCH", "/v1/volumes/" + std::string(64, '0'), "{\"name\":null}", json).status,
      404);
  EXPECT_THAT(daemon_.errors(), Not(HasSubstr("ller")));
  EXPECT_THAT(daemon_.errors(), Not(HasSubstr("skull")));
}

// The same samples are stored once. A mesh of one volume serves the other, because it does not
// carry the note.
TEST_F(NotesTest, AreOfTheVolumeOfTheirUpload) {
  const Volume first = volume_from_json(daemon_.send("POST", "/v1/volumes", nrrd(kSpaced)).body);
  const Answer other = daemon_.send("POST", "/v1/volumes", nrrd(kSpaced, kSamples + "more"));
  EXPECT_EQ(other.status, 201);
  const Volume volume = volume_from_json(other.body);
  EXPECT_THAT(volume.notes, ElementsAre(Field(&Note::code, "trailing-bytes")));
  EXPECT_NE(volume.id, first.id);
  EXPECT_EQ(volume.samples, first.samples);
  EXPECT_EQ(daemon_.client().volume(volume.id), volume);
  EXPECT_EQ(daemon_.client().volume(first.id), first);
  const Answer third = daemon_.send("POST", "/v1/volumes", nrrd(kSpaced));
  EXPECT_EQ(third.status, 200);
  EXPECT_EQ(volume_from_json(third.body), first);
  const auto mesh = [&](const Volume& of) {
    return daemon_.client().wait(submit(daemon_, of, 110).id);
  };
  EXPECT_EQ(mesh(first).state, JobState::kSucceeded);
  EXPECT_TRUE(mesh(volume).reused);
}

TEST_F(NotesTest, OneFileTwiceInAnArchiveIsOneVolume) {
  const Shown twice = {{{"a.nrrd", nrrd(kSpaced)}, {"copy of a.nrrd", nrrd(kSpaced)}}};
  const Finished uploaded = upload_files(twice, "twice");
  ASSERT_EQ(uploaded.status, 0) << uploaded.errors;
  const Volume volume = volume_from_json(uploaded.output);
  EXPECT_EQ(volume.name, "a.nrrd");
  EXPECT_THAT(volume.notes, ElementsAre(Field(&Note::code, "duplicate-file")));
  EXPECT_THAT(volume.ignored, ElementsAre(Field(&IgnoredObject::name, "copy of a.nrrd")));
}

}  // namespace isomesh::test
}  // namespace isomesh::test
