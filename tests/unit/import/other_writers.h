// Small files of formats of other fields than medicine, and of programs for research, written
// plainly and apart from the importers. Samples are bytes in the file's order.
#pragma once

#include <array>
#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

namespace isomesh::import::test {

struct MghFields {
  std::array<std::int32_t, 4> sizes = {4, 3, 2, 1};
  std::int32_t type = 0;
  std::int16_t has_axes = 1;
  std::vector<float> spacing = {1, 1, 1};
  std::vector<float> cosines = {1, 0, 0, 0, 1, 0, 0, 0, 1};  // axis by axis, in RAS
  std::vector<float> centre = {0, 0, 0};
};
std::string mgh(const MghFields& fields, std::string_view samples);

// A header of version 1 with this dictionary.
std::string npy(const std::string& dictionary, std::string_view samples);
std::string npy_header(const std::string& type, bool is_fortran, const std::string& shape);

struct MrcFields {
  bool big_endian = false;
  std::vector<std::int32_t> sizes = {4, 3, 2};
  std::int32_t mode = 0;
  std::vector<std::int32_t> start = {0, 0, 0};
  std::vector<std::int32_t> sampling = {4, 3, 2};
  std::vector<float> cell = {4, 3, 2};
  std::vector<float> angles = {90, 90, 90};
  std::vector<std::int32_t> axes = {1, 2, 3};
  std::int32_t space_group = 1;
  std::string extended = {};
  std::vector<float> origin = {0, 0, 0};
};
std::string mrc(const MrcFields& fields, std::string_view samples);

struct CubeFields {
  std::string atoms = "1 0 0 0";  // their number, the origin, maybe the number of values
  std::vector<std::string> axes = {"2 1 0 0", "3 0 1 0", "4 0 0 1"};
  std::string behind_atoms = {};  // lines of orbitals
};
std::string cube(const CubeFields& fields, const std::string& numbers);

// `points` is the number of points along x, y and z; `data` is what follows the header.
std::string vtk_legacy(bool is_text, const std::string& data, const std::string& points = "4 3 2");

// A header of 4 x 3 x 2 samples of one byte, 1 mm apart, with these attributes added or replaced:
// name, type ("integer") and value.
struct AfniAttribute {
  std::string name;
  std::string type;
  std::string value;
};
std::string afni_head(const std::vector<AfniAttribute>& attributes = {});

struct IsqFields {
  std::int32_t type = 3;
  std::vector<std::int32_t> samples = {4, 3, 2};
  std::vector<std::int32_t> micrometres = {40, 60, 60};
  std::int32_t first_slice_um = 1500;
  std::int32_t blocks = 0;
};
std::string isq(const IsqFields& fields, std::string_view samples);

// MRtrix' header lines, with x and y stored backwards, and 4 x 3 x 2 samples.
struct MifFields {
  std::string dim = "4,3,2";
  std::string layout = "-0,-1,+2";
  std::string datatype = "UInt8";
  std::string more = {};
  std::string file = {};  // empty: behind the header
  std::string transform = "transform: 1,0,0,10\ntransform: 0,1,0,20\ntransform: 0,0,1,30\n";
};
std::string mif(const MifFields& fields, std::string_view samples);

struct GiplFields {
  std::vector<std::uint16_t> sizes = {4, 3, 2, 1};
  std::uint16_t type = 8;
  std::vector<float> spacing = {1, 1, 1, 1};
  std::vector<double> origin = {0, 0, 0, 0};
};
std::string gipl(const GiplFields& fields, std::string_view samples);

// A PAR of version 4.2 with images of 4 x 3 samples of one byte.
struct ParImage {
  int slice = 1;
  int instant = 1;
  int place = 0;
  double slope = 1;
};
std::string par(const std::vector<ParImage>& images);

// A tag of each page, above all others: bytes, or one number if they are four.
struct TiffTag {
  std::uint16_t tag = 0;
  std::string bytes = {};
};

// A TIFF with pages of 4 x 3 samples of one byte, without compression, in one strip each.
std::string tiff(const std::vector<std::string>& pages, const std::string& description = {},
                 int orientation = 1, const TiffTag& more = {});

// Grey images of one byte a sample, with rows of `width` samples.
std::string grey_png(std::uint32_t width, std::string_view samples);
std::string grey_bmp(std::uint32_t width, std::string_view samples);

}  // namespace isomesh::import::test
