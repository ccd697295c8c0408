#include "tests/unit/import/other_writers.h"

#include <algorithm>

#include <zlib.h>

#include "tests/unit/import/writers.h"

namespace isomesh::import::test {
namespace {

template <class Number>
std::string one(Number number, bool big_endian = false) {
  return bytes_of(std::vector<Number>{number}, big_endian);
}

void put(std::string& file, std::size_t at, std::string_view bytes) {
  std::ranges::copy(bytes, file.begin() + static_cast<std::ptrdiff_t>(at));
}

}  // namespace

std::string mgh(const MghFields& fields, std::string_view samples) {
  std::string header(284, '\0');
  put(header, 0, one<std::int32_t>(1, true));
  put(header, 4, bytes_of(std::vector(fields.sizes.begin(), fields.sizes.end()), true));
  put(header, 20, one(fields.type, true));
  put(header, 28, one(fields.has_axes, true));
  put(header, 30, bytes_of(fields.spacing, true));
  put(header, 42, bytes_of(fields.cosines, true));
  put(header, 78, bytes_of(fields.centre, true));
  return header + std::string(samples);
}

std::string npy(const std::string& dictionary, std::string_view samples) {
  return "\x93NUMPY" + std::string("\1\0", 2) + one(static_cast<std::uint16_t>(dictionary.size())) +
         dictionary + std::string(samples);
}

std::string npy_header(const std::string& type, bool is_fortran, const std::string& shape) {
  return "{'descr': '" + type + "', 'fortran_order': " + (is_fortran ? "True" : "False") +
         ", 'shape': " + shape + ", }\n";
}

std::string mrc(const MrcFields& f, std::string_view samples) {
  std::string header(1024, '\0');
  put(header, 0, bytes_of(f.sizes, f.big_endian));
  put(header, 12, one(f.mode, f.big_endian));
  put(header, 16, bytes_of(f.start, f.big_endian));
  put(header, 28, bytes_of(f.sampling, f.big_endian));
  put(header, 40, bytes_of(f.cell, f.big_endian));
  put(header, 52, bytes_of(f.angles, f.big_endian));
  put(header, 64, bytes_of(f.axes, f.big_endian));
  put(header, 88, one(f.space_group, f.big_endian));
  put(header, 92, one(static_cast<std::int32_t>(f.extended.size()), f.big_endian));
  put(header, 196, bytes_of(f.origin, f.big_endian));
  put(header, 208, "MAP ");
  put(header, 212, f.big_endian ? "\x11\x11" : "\x44\x44");
  return header + f.extended + std::string(samples);
}

std::string cube(const CubeFields& fields, const std::string& numbers) {
  std::string file = "title\ncomment\n" + fields.atoms + '\n';
  for (const std::string& axis : fields.axes) file += axis + '\n';
  return file + "6 6.0 0.0 0.0 0.0\n" + fields.behind_atoms + numbers;
}

std::string vtk_legacy(bool is_text, const std::string& data, const std::string& points) {
  return std::string("# vtk DataFile Version 3.0\ntitle\n") + (is_text ? "ASCII" : "BINARY") +
         "\nDATASET STRUCTURED_POINTS\nDIMENSIONS " + points +
         "\nSPACING 1 2 3\nORIGIN 10 20 30\n" + data;
}

std::string afni_head(const std::vector<AfniAttribute>& attributes) {
  std::vector<AfniAttribute> all = {{"TYPESTRING", "string", "'3DIM_HEAD_ANAT~"},
                                    {"ORIENT_SPECIFIC", "integer", "0 3 4"},
                                    {"ORIGIN", "float", "0 0 0"},
                                    {"DELTA", "float", "1 1 1"},
                                    {"DATASET_RANK", "integer", "3 1 0 0 0 0 0 0"},
                                    {"DATASET_DIMENSIONS", "integer", "4 3 2 0 0"},
                                    {"BRICK_TYPES", "integer", "0"},
                                    {"BYTEORDER_STRING", "string", "'LSB_FIRST~"}};
  for (const AfniAttribute& attribute : attributes) {
    std::erase_if(all, [&](const AfniAttribute& other) { return other.name == attribute.name; });
    all.push_back(attribute);
  }
  std::string file;
  for (const AfniAttribute& attribute : all) {
    file += "\ntype  = " + attribute.type + "-attribute\nname  = " + attribute.name +
            "\ncount = 1\n " + attribute.value + '\n';
  }
  return file;
}

std::string isq(const IsqFields& fields, std::string_view samples) {
  std::string header(512, '\0');
  put(header, 0, "CTDATA-HEADER_V1");
  put(header, 16, one(fields.type));
  put(header, 44, bytes_of(fields.samples));
  put(header, 56, bytes_of(fields.micrometres));
  put(header, 76, one(fields.first_slice_um));
  put(header, 508, one(fields.blocks));
  const auto skipped = static_cast<std::size_t>(std::clamp(fields.blocks, 0, 10)) * 512;
  return header + std::string(skipped, '\0') + std::string(samples);
}

std::string mif(const MifFields& fields, std::string_view samples) {
  const std::string header = "mrtrix image\ndim: " + fields.dim +
                             "\nvox: 2,3,4,nan\nlayout: " + fields.layout +
                             "\ndatatype: " + fields.datatype + "\n" + fields.transform +
                             "command_history: x: y\n" + fields.more;
  if (!fields.file.empty()) return header + "file: " + fields.file + "\nEND\n";
  constexpr std::size_t kOffset = 512;
  std::string file = header + "file: . " + std::to_string(kOffset) + "\nEND\n";
  file.resize(kOffset, '\0');
  return file + std::string(samples);
}

std::string gipl(const GiplFields& fields, std::string_view samples) {
  std::string header(256, '\0');
  put(header, 0, bytes_of(fields.sizes, true));
  put(header, 8, one(fields.type, true));
  put(header, 10, bytes_of(fields.spacing, true));
  put(header, 204, bytes_of(fields.origin, true));
  put(header, 252, one<std::uint32_t>(0xefffe9b0, true));
  return header + std::string(samples);
}

std::string par(const std::vector<ParImage>& images) {
  std::string file =
      "# === DATA DESCRIPTION FILE ===\n"
      "# CLINICAL TRYOUT             Research image export tool     V4.2\n"
      ".    Angulation midslice(ap,fh,rl)[degr]:   0 0 0\n"
      ".    Off Centre midslice(ap,fh,rl) [mm] :   10 20 30\n";
  for (const ParImage& image : images) {
    file += std::to_string(image.slice) + " 1 " + std::to_string(image.instant) + " 1 0 2 " +
            std::to_string(image.place) + " 8 100 4 3 0 " + std::to_string(image.slope) +
            " 1 1 1 0 0 0 0 0 0 2 1 0 1 0 2 1.5 1.25 0 0 0 0 1 90 0 0 0 0 0 1 1 7 0 0 0 0 1\n";
  }
  return file;
}

namespace {

// An entry of a TIFF's directory; `type` 3 is short, 4 is long, 2 is text.
std::string tiff_entry(std::uint16_t tag, std::uint16_t type, std::uint32_t count,
                       std::uint32_t value) {
  return one(tag) + one(type) + one(count) + one(value);
}

}  // namespace

std::string tiff(const std::vector<std::string>& pages, const std::string& description,
                 int orientation, const TiffTag& more) {
  std::string file = "II*" + std::string(1, '\0') + one<std::uint32_t>(0);
  std::size_t link = 4;
  const auto size = [&] { return static_cast<std::uint32_t>(file.size()); };
  for (const std::string& page : pages) {
    const std::uint32_t samples = size();
    file += page;
    const std::uint32_t text = size();
    file += description + std::string(1 + (description.size() + page.size() + 1) % 2, '\0');
    const std::uint32_t further = size();
    file += more.bytes;
    put(file, link, one(size()));
    std::vector<std::string> entries = {
        tiff_entry(256, 3, 1, 4),
        tiff_entry(257, 3, 1, 3),
        tiff_entry(258, 3, 1, 8),
        tiff_entry(259, 3, 1, 1),
        tiff_entry(262, 3, 1, 1),
        tiff_entry(270, 2, static_cast<std::uint32_t>(description.size() + 1), text),
        tiff_entry(273, 4, 1, samples),
        tiff_entry(274, 3, 1, static_cast<std::uint32_t>(orientation)),
        tiff_entry(277, 3, 1, 1),
        tiff_entry(278, 3, 1, 3),
        tiff_entry(279, 4, 1, static_cast<std::uint32_t>(page.size()))};
    if (more.bytes.size() == 4) {
      entries.push_back(one(more.tag) + one<std::uint16_t>(4) + one<std::uint32_t>(1) + more.bytes);
    } else if (!more.bytes.empty()) {
      entries.push_back(
          tiff_entry(more.tag, 1, static_cast<std::uint32_t>(more.bytes.size()), further));
    }
    const bool has_text = description.size() > 3;
    file += one(static_cast<std::uint16_t>(entries.size() - (has_text ? 0 : 1)));
    for (std::size_t at = 0; at < entries.size(); ++at) {
      if (at != 5 || has_text) file += entries[at];
    }
    link = file.size();
    file += one<std::uint32_t>(0);
  }
  return file;
}

std::string grey_png(std::uint32_t width, std::string_view samples) {
  std::string rows;
  for (std::size_t at = 0; at < samples.size(); at += width) {
    rows += std::string(1, '\0') + std::string(samples.substr(at, width));
  }
  const auto chunk = [](const std::string& kind, const std::string& data) {
    const std::string both = kind + data;
    const auto sum =
        crc32(0, reinterpret_cast<const Bytef*>(both.data()), static_cast<uInt>(both.size()));
    return one(static_cast<std::uint32_t>(data.size()), true) + both +
           one(static_cast<std::uint32_t>(sum), true);
  };
  const auto height = static_cast<std::uint32_t>(samples.size() / width);
  return "\x89PNG\r\n\x1a\n" +
         chunk("IHDR", one(width, true) + one(height, true) + std::string("\x08\0\0\0\0", 5)) +
         chunk("IDAT", zlib(rows)) + chunk("IEND", "");
}

std::string grey_bmp(std::uint32_t width, std::string_view samples) {
  std::string header(54, '\0');
  put(header, 0, "BM");
  put(header, 10, one<std::uint32_t>(54 + 1024));
  put(header, 14, one<std::uint32_t>(40));
  put(header, 18, one(width));
  put(header, 22, one(static_cast<std::uint32_t>(samples.size() / width)));
  put(header, 26, one<std::uint16_t>(1));
  put(header, 28, one<std::uint16_t>(8));
  for (int grey = 0; grey < 256; ++grey) header += std::string(3, static_cast<char>(grey)) + '\0';
  for (std::size_t end = samples.size(); end > 0; end -= width) {
    header += std::string(samples.substr(end - width, width)) + std::string((4 - width % 4) % 4, 0);
  }
  return header;
}

}  // namespace isomesh::import::test
