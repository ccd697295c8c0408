#include <cstring>

#include "proto/json.h"
#include "server/import/message/import_message.h"
#include "server/volume/canonical.h"
#include "tests/fuzz/dicom_corpus.h"
#include "tests/fuzz/draco_target.h"
#include "tests/fuzz/targets.h"
#include "tests/unit/import/archives.h"
#include "tests/unit/import/files.h"
#include "tests/unit/import/other_writers.h"
#include "tests/unit/import/pictures.h"
#include "tests/unit/import/vti_writer.h"
#include "tests/unit/import/writers.h"
#include "tests/unit/import/zarr_files.h"

namespace isomesh::fuzz {
namespace {

using namespace import::test;

const std::string kSamples(kSmallSamples);

// With a table of labels in an extension of 96 bytes.
std::string labelled_nifti() {
  std::string text =
      "<LabelTable><Label Key=\"1\" Red=\"1\" Green=\"0\" Blue=\"0\">liver</Label></LabelTable>";
  text.resize(88, '\0');
  return nifti({.vox_offset = 448}, "").substr(0, 348) + std::string("\1\0\0\0", 4) +
         bytes_of(std::vector<std::int32_t>{96, 30}) + text + kSamples;
}

std::string layered_nrrd() {
  std::string file = nrrd(with(with(with(with(small_nrrd(), "dimension", "4"), "sizes", "2 3 2 2"),
                                    "kinds", "list domain domain domain"),
                               "space directions", "none (1,0,0) (0,1,0) (0,0,1)"),
                          kSamples);
  return file.insert(file.find("\n\n") + 1,
                     "Segment0_Name:=liver\nSegment0_LabelValue:=1\nSegment0_Layer:=0\n"
                     "Segment0_Color:=1 0.5 0\nSegment1_LabelValue:=1\nSegment1_Layer:=1\n");
}

std::string nrrd_of_mitk() {
  std::string file = nrrd(small_nrrd(), kSamples);
  return file.insert(file.find("\n\n") + 1,
                     "modality:=org.mitk.multilabel.segmentation\n"
                     "org.mitk.multilabel.segmentation.labelgroups:=[{\"labels\": [{\"value\": 97, "
                     "\"name\": \"a\", \"color\": {\"value\": [1, 0, 0]}}]}]\n");
}

std::vector<std::string> nifti_files() {
  return {
      labelled_nifti(),
      nifti({}, kSamples),
      nifti({.version = 2, .big_endian = true}, kSamples),
      gzip(nifti({.qform_code = 1, .sform_code = 0}, kSamples)),
      nifti({.dim = {3, 2, 3, 2, 1, 1, 1, 1}, .datatype = 512, .bitpix = 16, .slope = 2}, kSamples),
      nifti({.dim = {4, 2, 3, 2, 2, 1, 1, 1}}, kSamples)};
}

std::vector<std::string> label_texts() {
  return {"# Color table file x.ctbl\n3 soft_tissue 111 184 210 255\n4 (none) 0 0 0 0\n",
          "0 0 0 0 0 0 0 \"Clear Label\"\n2 255 0 0 1 1 1 \"Deep R\"\n",
          "1 0.93 0.2 0 Frontal Pole\n",
          "1 Precentral_L 2001\r\n2 Precentral_R 2002\r\n",
          R"({"labels": {"background": 0, "spleen": 1}})",
          R"([{"labelValue": 1, "name": "spleen", "color": [0.9, 0.6, 1]}])"};
}

std::vector<std::string> nrrd_files() {
  const auto encoded = [](const std::string& encoding, const std::string& payload) {
    return nrrd(with(small_nrrd(), "encoding", encoding), payload);
  };
  std::string digits;
  for (int at = 0; at < 24; ++at) digits += std::to_string(at) + " ";
  return {nrrd(small_nrrd(), kSamples),
          layered_nrrd(),
          nrrd_of_mitk(),
          encoded("gzip", gzip(kSamples)),
          encoded("ascii", digits),
          encoded("hex", std::string(48, 'a')),
          encoded("bzip2", bzip2(kSamples)),
          nrrd(with(with(small_nrrd(), "kinds", "list domain domain"), "space directions",
                    "none (1,0,0) (0,1,0)"),
               kSamples),
          gzip(nrrd(small_nrrd(), kSamples))};
}

std::vector<std::string> metaimage_files() {
  return {
      metaimage(small_metaimage(), kSamples),
      metaimage(with(small_metaimage(), "CompressedData", "True"), zlib(kSamples)),
      metaimage(with(with(small_metaimage(), "BinaryData", "False"), "DimSize", "2 1 1"), "1 2"),
      "ObjectType = Image\nNDims = 4\nDimSize = 2 3 2 2\nElementSpacing = 1 1 1 0.5\n"
      "Seq_Frame0000_Timestamp = 7\nElementType = MET_UCHAR\nElementDataFile = LOCAL\n" +
          kSamples};
}

std::vector<std::string> vti_files() {
  std::vector<std::string> files;
  for (const VtiForm form : {VtiForm::kBinary, VtiForm::kAppendedRaw, VtiForm::kAppendedBase64}) {
    for (const bool compressed : {false, true}) {
      files.push_back(vti({.form = form, .compressed = compressed}, kSamples));
    }
  }
  files.push_back(vti({.form = VtiForm::kAscii, .extent = "0 1 0 0 0 1"}, "1 2 3 4"));
  files.push_back(gzip(vti({}, kSamples)));
  return files;
}

std::vector<std::string> vtk_files() {
  const std::string scalars = "SCALARS s unsigned_char 1\nLOOKUP_TABLE default\n";
  return {vtk_legacy(false, "POINT_DATA 24\n" + scalars + kSamples),
          vtk_legacy(true, "CELL_DATA 6\nFIELD f 1\nv 2 1 float\n1 2\nMETADATA\nx\n\n" + scalars +
                               "1 2 3 4 5 6\n")};
}

std::vector<std::string> mrc_files() {
  return {mrc({}, kSamples), mrc({.big_endian = true, .axes = {3, 1, 2}}, kSamples),
          mrc({.sizes = {4, 3, 1}, .mode = 12, .angles = {90, 90, 120}}, kSamples),
          mrc({.sampling = {4, 3, 1}, .space_group = 401, .extended = "more"}, kSamples)};
}

std::vector<std::string> cube_files() {
  const std::string numbers = "0 1 2 3 4 5 6 7 8 9 10 11 12 13 14 15 16 17 18 19 20 21 22 23\n";
  return {cube({}, numbers), cube({.atoms = "-1 0 0 0",
                                   .axes = {"2 1 0 0", "-3 0 1 0", "2 0 0 1"},
                                   .behind_atoms = "2 1\n2\n"},
                                  numbers)};
}

std::vector<std::string> numpy_files() {
  return {npy(npy_header("|u1", false, "(2, 3, 4)"), kSamples),
          npy(npy_header(">f2", true, "(2, 1, 3, 2)"), kSamples)};
}

// Indices of 4 bits, colours and one bit: each 4 x 3 pixels.
const PictureFields kIndexed = {.bits = 4, .palette = {{0, 0, 0}, {255, 0, 0}, {9, 9, 9}}};
const PictureFields kWithOpacity = {.components = 4, .has_opacity = true};
const PictureFields kBits = {.bits = 1};

std::vector<std::string> png_files() {
  return {grey_png(4, kSamples), png_picture(kIndexed, kSamples.substr(0, 6)),
          png_picture(kWithOpacity, std::string(48, '\xff')),
          png_picture(kBits, kSamples.substr(0, 3))};
}

std::vector<std::string> bmp_files() {
  return {grey_bmp(4, kSamples), bmp_picture(kIndexed, kSamples.substr(0, 6)),
          bmp_picture(kWithOpacity, std::string(48, '\xff'))};
}

std::vector<std::string> tiff_files() {
  const std::vector<std::string> pages = {kSamples.substr(0, 12), kSamples.substr(12)};
  std::vector<std::string> files = {
      tiff(pages), tiff({kSamples}, "ImageJ=1\nimages=2\nslices=2\n"),
      tiff(pages,
           "<OME UUID='u'><Pixels DimensionOrder='XYZCT' SizeZ='2' SizeC='2'><TiffData IFD='1'/>"
           "<TiffData FirstZ='1' PlaneCount='1'><UUID>u</UUID></TiffData></Pixels></OME>",
           3)};
  for (const char* const description :
       {"ImageJ=1\nimages=2\nslices=2\nunit=mm\nspacing=2\n",
        "<OME><Pixels DimensionOrder='XYZCT' SizeZ='2' PhysicalSizeX='1'/></OME>",
        R"({"shape": [2, 1, 3, 4], "axes": "ZCYX"})",
        "SCIFIO=0.41.0\naxes=X,Y,Z\nlengths=4,3,2\nscales=1,1,1\nunits=mm,mm,mm\n"}) {
    files.push_back(tiff(pages, description));
  }
  files.push_back(tiff_picture(kIndexed, {kSamples.substr(0, 6), kSamples.substr(6, 6)}));
  files.push_back(tiff_picture(kWithOpacity, {std::string(48, '\xff')}));
  files.push_back(tiff_picture({.bits = 16, .format = 3}, {kSamples}));
  return files;
}

std::vector<std::string> afni_files() {
  return {afni_head(), afni_head({{"IJK_TO_DICOM_REAL", "float", "2 0 0 7 0 2 0 8 0 0 2 9"},
                                  {"BRICK_FLOAT_FACS", "float", "2"}})};
}

constexpr std::string_view kZarrGroup =
    R"({"multiscales": [{"axes": ["z", "y", "x"], "datasets": [{"path": "0",)"
    R"( "coordinateTransformations": [{"type": "scale", "scale": [3, 2, 1]}]}]}],)"
    R"( "image-label": {"colors": [{"label-value": 97, "rgba": [255, 0, 0, 255]}]}})";

// Files of the formats whose writers need no more than one line.
std::vector<std::string> other_files(std::string_view name) {
  if (name == "vtk") return vtk_files();
  if (name == "mgh") return {mgh({}, kSamples), mgh({.sizes = {4, 3, 1, 2}}, kSamples)};
  if (name == "afni") return afni_files();
  if (name == "par") return {par({{.slice = 1}, {.slice = 2, .place = 1, .slope = 2}})};
  if (name == "isq") return {isq({}, kSamples + kSamples)};
  if (name == "mrc") return mrc_files();
  if (name == "cube") return cube_files();
  if (name == "numpy") return numpy_files();
  if (name == "gipl") return {gipl({}, kSamples), gipl({.sizes = {4, 3, 1, 2}}, kSamples)};
  if (name == "mif") return {mif({}, kSamples), mif({.layout = "+2,-1,+0"}, kSamples)};
  if (name == "zarr") return {std::string(kZarrGroup)};
  if (name == "tiff") return tiff_files();
  if (name == "png") return png_files();
  if (name == "bmp") return bmp_files();
  return {};
}

// Their codecs are transposed axes, shards, Zstandard, Blosc and checksums.
std::vector<std::string> zarr_archives() {
  using namespace import::test::zarr;
  const std::string turned =
      R"({"name": "transpose", "configuration": {"order": [2, 1, 0]}}, "bytes", )";
  const auto summed = [](const std::string& chunk) { return with_sum(zarr::zstd(chunk)); };
  const auto packed = [](const std::string& chunk) { return blosc(chunk, "lz4", BLOSC_SHUFFLE); };
  const auto shards = [](const std::string& chunk) {
    return chunk + bytes_of(std::vector<std::uint64_t>{0, 4, 4, 4});
  };
  return {tar(zarr_3(turned + R"("zstd", "crc32c")", summed, true)),
          tar(zarr_3(turned + "\"blosc\"", packed, true)),
          tar(zarr_3(sharding("\"bytes\""), shards))};
}

std::vector<std::string> archive_files() {
  const std::string mhd = metaimage(with(small_metaimage(), "ElementDataFile", "a.raw"), "");
  const std::string nhdr = nrrd(with(small_nrrd(), "data file", "a.raw"), "");
  const std::string skips = nrrd(
      with(with(with(small_nrrd(), "data file", "a.raw"), "line skip", "1"), "byte skip", "2"), "");
  const std::vector<float> labels(24, 2);
  return {zip({{"a.mhd", mhd}, {"a.raw", kSamples}}),
          zip({{"a.nhdr", skips}, {"a.raw", "a line\n##" + kSamples}}),
          zip({{"a.nii", nifti({.datatype = 16, .bitpix = 32}, bytes_of(labels))},
               {"a.txt", "2 liver\n"}}),
          tar({{"a.nhdr", nhdr}, {"a.raw", kSamples}}),
          gzip(tar({{"a.nii", nifti({}, kSamples)}})),
          without_name(tar({{"a.nii", nifti({}, kSamples)}, {"b", "text"}}), "b"),
          tar({{"1", kSamples.substr(0, 12)},
               {"2", kSamples.substr(12)},
               {"a.mhd", metaimage(with(small_metaimage(), "ElementDataFile", "%01d 1 2 1"), "")}}),
          tar({{".zattrs", std::string(kZarrGroup)},
               {"0/.zarray",
                R"({"zarr_format": 2, "shape": [2, 3, 4], "chunks": [1, 3, 4], "dtype": "|u1",)"
                R"( "order": "C", "fill_value": 0, "compressor": {"id": "zlib"}})"},
               {"0/0.0.0", zlib(kSamples.substr(0, 12))},
               {"0/1.0.0", zlib(kSamples.substr(12))}}),
          zip({{"a.hdr", nifti({.magic = "ni1", .vox_offset = 0}, "")}, {"a.img", kSamples}}),
          zip({{"a.nii", nifti({}, kSamples)}, {"b.nii", nifti({}, kSamples)}}),
          zip({{"a.nii.gz", gzip(nifti({}, kSamples))}, {"README", "text"}})};
}

std::vector<std::string> raw_files() {
  std::string file = {'\x04', '\x03', '\x02', '\0', '\0', '\0', '\0', '\0'};
  const std::vector<double> geometry = {0, 0, 0, 1, 1, 1, 1, 0, 0, 0, 1, 0, 0, 0, 1};
  return {file + bytes_of(geometry) + kSamples};
}

std::vector<std::string> canonical_files() { return {import_bytes(nifti({}, kSamples)).canonical}; }

std::vector<std::string> report_texts() {
  auto order = import::ImportOrder();
  order.task.options.raw = RawDescription{};
  const Error error(ErrorCode::kUnusableVolume, "why", {{"field", "message"}});
  return {import::reading_message("nifti") + import::volume_message(Volume{}),
          import::error_message(error), import::to_message(order)};
}

std::vector<std::string> json_texts() {
  return {R"({"volume": "a", "iso": 60, "scheme": 5, "passes": 3, "formats": ["drc", "stl"],)"
          R"( "draco": {"position_bits": 11, "speed": 0}})",
          to_json(Volume{}),
          to_json(Job{}),
          to_json(std::vector{Volume{}}),
          to_json(std::vector{Job{}}),
          to_json(Problem{"", "a", 0, "b", "", {{"c", "d"}}})};
}

}  // namespace

std::vector<std::string> corpus(std::string_view name) {
  if (name == "nifti") return nifti_files();
  if (name == "nrrd") return nrrd_files();
  if (name == "metaimage") return metaimage_files();
  if (name == "vti") return vti_files();
  if (auto files = other_files(name); !files.empty()) return files;
  if (name == "dicom") return dicom_objects();
  if (name == "structures") return structure_sets();
  if (name == "ascconv") return siemens_protocols();
  if (name == "csa") return csa_headers();
  if (name == "archive") {
    std::vector<std::string> files = archive_files();
    for (const std::string& file : zarr_archives()) files.push_back(file);
    return files;
  }
  if (name == "labels") return label_texts();
  if (name == "raw") return raw_files();
  if (name == "canonical") return canonical_files();
  if (name == "report") return report_texts();
  if (name == "json") return json_texts();
  if (name == "draco") return meshes_to_encode();
  std::vector<std::string> all;
  for (const Target& target : targets()) {
    if (target.name == name) continue;
    for (const std::string& file : corpus(target.name)) all.push_back(file);
  }
  return all;
}

}  // namespace isomesh::fuzz
