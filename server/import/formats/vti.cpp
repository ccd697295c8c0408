#include <algorithm>
#include <array>
#include <cmath>
#include <string>
#include <utility>
#include <vector>

#include "base/files.h"
#include "base/text.h"
#include "base/xml_reader.h"
#include "proto/error.h"
#include "server/import/formats/format_readers.h"
#include "server/import/formats/vtk.h"
#include "server/import/source/header_fields.h"

namespace isomesh::import {
namespace {

struct VtiArray {
  HeaderTexts attributes;
  CompressedRange text;  // the byte range between its tags
};

// The parts of the document that a volume needs.
struct VtiDocument {
  HeaderTexts file;
  HeaderTexts image;
  HeaderTexts piece;
  HeaderTexts point_data;
  HeaderTexts cell_data;
  std::size_t pieces = 0;
  std::vector<VtiArray> point_arrays;
  std::vector<VtiArray> cell_arrays;
  HeaderTexts appended;
  std::uint64_t appended_at = 0;  // file offset of its data; 0: none
};

// Parses a document incrementally up to its appended data, which is not XML.
class VtiParser : public XmlHandler {
 public:
  enum class Until { kImage, kSamples };

  VtiParser(const InputFile& file, Until until) : file_(file), until_(until) {}

  VtiDocument parse() {
    constexpr std::size_t kXmlPieceBytes = std::size_t{1} << 16;
    for (std::uint64_t next = 0; !reader_.is_stopped();) {
      const std::string piece = file_.text(next, kXmlPieceBytes);
      next += piece.size();
      const bool last = next >= file_.size();
      try {
        reader_.read(piece, last);
      } catch (const XmlError& error) {
        throw_unusable("The VTK file is not valid XML: " + std::string(error.what()) + ".");
      }
      if (last) break;
      check_progress(next);
    }
    return std::move(document_);
  }

 private:
  // expat rescans an unfinished tag or comment with each piece, so their length is bounded.
  void check_progress(std::uint64_t read) const {
    constexpr std::uint64_t kLongest = std::uint64_t{1} << 20;
    if (read > kLongest && reader_.begin() < read - kLongest) {
      throw_unusable("The VTK file has a tag or a comment of more than " +
                     std::to_string(kLongest) + " bytes.");
    }
  }

  void encoding(std::string_view encoding) override {
    // Other encodings do not allow reading the samples' text byte by byte.
    const std::string name = lower(encoding);
    if (name == "utf-8" || name == "us-ascii" || name == "iso-8859-1") return;
    throw_unusable("The VTK file's encoding " + in_quotes(name) + " is not supported.");
  }

  void start_element(std::string_view name, const XmlAttributes& pairs) override {
    constexpr std::size_t kDeepest = 32;
    constexpr std::size_t kMostElements = 100'000;
    // Longer than any name that is looked for. Each element costs a copy of the names around it.
    constexpr std::size_t kLongestName = 64;
    if (path_.size() >= kDeepest) throw_unusable("The VTK file's elements are nested too deeply.");
    if (++elements_ > kMostElements) {
      throw_unusable("The VTK file has more than the " + std::to_string(kMostElements) +
                     " elements that are supported.");
    }
    path_.emplace_back(name.substr(0, kLongestName));
    HeaderTexts attributes;
    pairs.for_each([&](const char* key, const char* value) { attributes.emplace(key, value); });
    const std::string place = joined_path();
    if (place == "VTKFile") {
      document_.file = std::move(attributes);
      check_kind();
    } else if (place == "VTKFile/ImageData") {
      document_.image = std::move(attributes);
      if (until_ == Until::kImage) reader_.stop();
    } else if (place == "VTKFile/ImageData/Piece") {
      document_.piece = std::move(attributes);
      ++document_.pieces;
    } else if (place == "VTKFile/ImageData/Piece/PointData") {
      document_.point_data = std::move(attributes);
    } else if (place == "VTKFile/ImageData/Piece/CellData") {
      document_.cell_data = std::move(attributes);
    } else if (auto* arrays = arrays_at(place)) {
      add_array(std::move(attributes), *arrays);
    } else if (place == "VTKFile/AppendedData") {
      document_.appended = std::move(attributes);
      document_.appended_at = reader_.end();
      reader_.stop();
    }
  }

  void end_element(std::string_view) override {
    if (auto* arrays = arrays_at(joined_path())) {
      CompressedRange& text = arrays->back().text;
      text.bytes = reader_.begin() - std::min(reader_.begin(), text.offset);
    }
    path_.pop_back();
  }

  void check_kind() const {
    const std::string_view type = value_of(document_.file, "type");
    if (type == "ImageData") return;
    throw_unusable("The VTK file holds " + in_quotes(type) + ", not ImageData.");
  }

  // The list that an array at this place belongs to; null for no array.
  std::vector<VtiArray>* arrays_at(std::string_view place) {
    if (place == "VTKFile/ImageData/Piece/PointData/DataArray") return &document_.point_arrays;
    if (place == "VTKFile/ImageData/Piece/CellData/DataArray") return &document_.cell_arrays;
    return nullptr;
  }

  void add_array(HeaderTexts attributes, std::vector<VtiArray>& arrays) const {
    constexpr std::size_t kMostArrays = 1000;
    if (arrays.size() == kMostArrays) {
      throw_unusable("The VTK file has more than the 1000 arrays that are supported.");
    }
    arrays.push_back({std::move(attributes), {reader_.end(), 0}});
  }

  std::string joined_path() const {
    std::string path;
    for (const std::string& name : path_) path += (path.empty() ? "" : "/") + name;
    return path;
  }

  const InputFile& file_;
  const Until until_;
  VtiDocument document_;
  std::vector<std::string> path_;
  std::size_t elements_ = 0;
  XmlReader reader_{*this};
};

// Reads the document up to its appended data, which is not XML. Throws Error kUnusableVolume if it
// is not well-formed, not an image, or uses XML features that VTK does not write.
VtiDocument read_vti_document(const InputFile& file) {
  return VtiParser(file, VtiParser::Until::kSamples).parse();
}

// Reads the image's attributes, which precede anything large. Throws as read_vti_document, also if
// they are missing because the file is truncated.
HeaderTexts read_vti_image(const InputFile& beginning) {
  HeaderTexts image = VtiParser(beginning, VtiParser::Until::kImage).parse().image;
  if (image.empty()) throw_unusable("The VTK file does not begin with the extent of an image.");
  return image;
}

// --- The image -----------------------------------------------------------------------------------

template <std::size_t Count>
std::array<double, Count> numbers_of(const HeaderTexts& attributes, std::string_view name,
                                     const std::array<double, Count>& otherwise) {
  const std::string_view text = value_of(attributes, name);
  if (text.empty()) return otherwise;
  const auto found = finite_numbers(text);
  if (found.size() != Count) {
    throw_unusable("The VTK file's " + in_quotes(name) + " is not " + std::to_string(Count) +
                   " finite numbers.");
  }
  std::array<double, Count> numbers;
  std::ranges::copy(found, numbers.begin());
  return numbers;
}

VtkExtent extent_of(const HeaderTexts& attributes, std::string_view name) {
  return vtk_extent(value_of(attributes, name), name);
}

Geometry geometry_of_image(const HeaderTexts& image, const VtkExtent& extent,
                           const Vector3& default_spacing) {
  Geometry geometry;
  geometry.spacing = numbers_of<3>(image, "Spacing", default_spacing);
  geometry.direction = numbers_of<9>(image, "Direction", geometry.direction);
  geometry.origin = numbers_of<3>(image, "Origin", {0, 0, 0});
  // The file's origin is the position of index (0,0,0), which may be outside of the extent.
  for (int axis = 0; axis < 3; ++axis) {
    const Vector3 step = step_of(geometry, axis);
    const auto count = static_cast<double>(extent.first[static_cast<std::size_t>(axis)]);
    for (std::size_t row = 0; row < 3; ++row) geometry.origin[row] += step[row] * count;
  }
  return geometry;
}

StoredType type_of(const VtiArray& array) {
  struct Row {
    std::string_view name;
    StoredType type;
  };
  static constexpr Row kTypes[] = {
      {"Int8", StoredType::kInt8},       {"UInt8", StoredType::kUint8},
      {"Int16", StoredType::kInt16},     {"UInt16", StoredType::kUint16},
      {"Int32", StoredType::kInt32},     {"UInt32", StoredType::kUint32},
      {"Int64", StoredType::kInt64},     {"UInt64", StoredType::kUint64},
      {"Float32", StoredType::kFloat32}, {"Float64", StoredType::kFloat64},
  };
  const std::string_view name = value_of(array.attributes, "type");
  for (const Row& row : kTypes) {
    if (row.name == name) return row.type;
  }
  throw_unusable("The VTK array's type " + in_quotes(name) +
                 " is not supported. A sample must be one real number.");
}

bool has_one_component(const VtiArray& array) {
  const std::string_view count = value_of(array.attributes, "NumberOfComponents");
  return count.empty() || parse_uint64(count) == 1;
}

using Arrays = std::vector<const VtiArray*>;

// The array that the file names as the scalars of points or cells. Without a name all that can be.
Arrays find_scalars(const HeaderTexts& data, const std::vector<VtiArray>& arrays) {
  const std::string_view scalars = value_of(data, "Scalars");
  Arrays found;
  for (const VtiArray& array : arrays) {
    const std::string_view name = value_of(array.attributes, "Name");
    const bool is_scalars =
        scalars.empty() ? has_one_component(array) && !is_vtk_mask(name) : name == scalars;
    if (is_scalars) found.push_back(&array);
  }
  if (!found.empty() || scalars.empty()) return found;
  throw_unusable("The VTK file has no array " + in_quotes(scalars) +
                 ", which it names as its scalars.");
}

struct Scalars {
  Arrays arrays;  // not empty
  bool is_of_cells = false;
};

// Cells count only without scalars of points.
Scalars scalars_of(const VtiDocument& document) {
  Arrays found = find_scalars(document.point_data, document.point_arrays);
  if (!found.empty()) return {std::move(found), false};
  found = find_scalars(document.cell_data, document.cell_arrays);
  if (!found.empty()) return {std::move(found), true};
  throw_unusable("The VTK file has no array of single numbers, of points or of cells.");
}

const VtiArray& choose_array(const Arrays& arrays, const ImportOptions& options,
                             SourceVolume& volume) {
  const auto title = [&](std::uint64_t index) {
    return vtk_array_title(value_of(arrays[index]->attributes, "Name"));
  };
  choose_volume(arrays.size(), {.what = "their array", .title = title}, options, volume);
  return *arrays[std::exchange(volume.chosen, {}).index];
}

// The lattice of the cells' centres. An axis of one point has one cell without extent.
void move_to_cells(SourceVolume& volume) {
  for (std::size_t axis = 0; axis < 3; ++axis) {
    if (volume.dims[axis] == 1) continue;
    --volume.dims[axis];
    const Vector3 step = step_of(volume.geometry, static_cast<int>(axis));
    for (std::size_t row = 0; row < 3; ++row) volume.geometry.origin[row] += step[row] / 2;
  }
}

void check_components(const VtiArray& array) {
  if (has_one_component(array)) return;
  throw_unusable("Each sample has " + in_quotes(value_of(array.attributes, "NumberOfComponents")) +
                 " components. A sample must be one real number.");
}

bool is_big_endian(const VtiDocument& document) {
  const std::string_view order = value_of(document.file, "byte_order");
  if (order == "LittleEndian") return false;
  if (order == "BigEndian") return true;
  throw_unusable("The VTK file's byte_order " + in_quotes(order) + " is unknown.");
}

bool has_wide_header(const VtiDocument& document) {
  const std::string_view type = value_of(document.file, "header_type");
  if (type.empty() || type == "UInt32") return false;
  if (type == "UInt64") return true;
  throw_unusable("The VTK file's header_type " + in_quotes(type) + " is unknown.");
}

VtkCompression compression_of(const VtiDocument& document) {
  const std::string_view compressor = value_of(document.file, "compressor");
  if (compressor.empty()) return VtkCompression::kNone;
  if (compressor == "vtkZLibDataCompressor") return VtkCompression::kZlib;
  if (compressor == "vtkLZ4DataCompressor") return VtkCompression::kLz4;
  if (compressor == "vtkLZMADataCompressor") return VtkCompression::kXz;
  throw_unusable("The VTK file's compressor " + in_quotes(compressor) + " is unknown.");
}

// Throws if an entity or a comment is among the samples, because the decoder would read it as
// samples.
void check_text(const InputFile& file, const CompressedRange& text) {
  for (std::uint64_t done = 0; done < text.bytes;) {
    const std::string piece =
        file.text(text.offset + done, std::min<std::uint64_t>(kPieceBytes, text.bytes - done));
    if (piece.empty() || piece.find_first_of("<&") != std::string::npos) {
      throw_unusable("The VTK array of the samples contains other elements.");
    }
    done += piece.size();
  }
}

// Appended data is not XML, so the parser does not notice a truncated file.
void check_end(const InputFile& file) {
  constexpr std::uint64_t kTailBytes = 256;
  const std::string tail = file.text(file.size() - std::min(kTailBytes, file.size()), kTailBytes);
  if (trimmed(tail).ends_with("</VTKFile>")) return;
  throw_unusable("The file is truncated: the end of the VTK file is missing.");
}

CompressedRange appended_range(const InputFile& file, const VtiDocument& document,
                               const VtiArray& array) {
  constexpr std::size_t kMostSpace = 4096;
  const auto offset = parse_uint64(value_of(array.attributes, "offset"));
  const std::string start = file.text(document.appended_at, kMostSpace);
  const std::size_t mark = start.find_first_not_of(" \t\r\n");
  if (!offset || document.appended_at == 0 || mark == std::string::npos || start[mark] != '_') {
    throw_unusable(
        "The VTK file's appended data cannot be found: the array's offset or the mark \"_\" is "
        "missing.");
  }
  const std::uint64_t begin = document.appended_at + mark + 1;
  if (*offset > file.size() - begin) {
    throw_unusable("The file is truncated: it ends before the VTK array of the samples.");
  }
  return {begin + *offset, file.size() - begin - *offset};
}

bool appended_is_base64(const VtiDocument& document) {
  const std::string_view encoding = value_of(document.appended, "encoding");
  if (encoding == "base64") return true;
  if (encoding == "raw") return false;
  throw_unusable("The encoding of the VTK file's appended data, " + in_quotes(encoding) +
                 ", is not supported. raw and base64 are.");
}

void place_samples(const InputFile& file, const VtiDocument& document, const VtiArray& array,
                   SourceVolume& volume) {
  const std::string_view format = value_of(array.attributes, "format");
  volume.payload = array.text;
  if (format == "ascii") {
    volume.encoding = Encoding::kText;
    return check_text(file, array.text);
  }
  volume.encoding = Encoding::kVtk;
  volume.layout.big_endian = is_big_endian(document);
  volume.vtk = {.base64 = true,
                .compression = compression_of(document),
                .wide_header = has_wide_header(document),
                .big_endian = volume.layout.big_endian};
  if (format == "binary") return check_text(file, array.text);
  if (format != "appended") {
    throw_unusable("The VTK array's format " + in_quotes(format) + " is unknown.");
  }
  check_end(file);
  volume.payload = appended_range(file, document, array);
  volume.vtk.base64 = appended_is_base64(document);
}

bool is_vti(std::string_view head) {
  constexpr std::string_view kByteOrderMark = "\xef\xbb\xbf";
  if (head.starts_with(kByteOrderMark)) head.remove_prefix(kByteOrderMark.size());
  return trimmed(head).starts_with('<') && head.find("<VTKFile") != std::string_view::npos;
}

bool may_hold_image(std::string_view head) {
  const std::size_t begin = std::min(head.find("<VTKFile"), head.size());
  const std::size_t end = head.find('>', begin);
  return end == std::string_view::npos ||
         head.substr(begin, end - begin).find("ImageData") != std::string_view::npos;
}

SourceVolume parse_vti(const InputFile& file, const Companions& /*companions*/,
                       const ImportOptions& options) {
  const VtiDocument document = read_vti_document(file);
  if (document.pieces != 1) {
    throw_unusable("The VTK file has " + std::to_string(document.pieces) +
                   " pieces. Exactly one is supported.");
  }
  if (!value_of(document.image, "TimeValues").empty()) {
    throw_unusable("The VTK file holds a time series. Only single volumes are supported.");
  }
  const VtkExtent extent = extent_of(document.image, "WholeExtent");
  if (extent_of(document.piece, "Extent") != extent) {
    throw_unusable("The VTK file's piece does not fill its whole extent.");
  }
  const auto [arrays, is_of_cells] = scalars_of(document);
  SourceVolume volume;
  const VtiArray& array = choose_array(arrays, options, volume);
  check_components(array);
  volume.dims = extent.dims;
  volume.assumes_spacing = value_of(document.image, "Spacing").empty();
  volume.geometry =
      geometry_of_image(document.image, extent, options.spacing.value_or(Vector3{1, 1, 1}));
  if (is_of_cells) move_to_cells(volume);
  volume.layout.type = type_of(array);
  place_samples(file, document, array, volume);
  return volume;
}

MostBytes most_vti_bytes(const InputFile& beginning, const ImportTask& task) {
  return most_vtk_bytes(extent_of(read_vti_image(beginning), "WholeExtent").dims, task);
}

}  // namespace

constinit const Reader kVtiReader = {.name = "vti",
                                     .sniff = is_vti,
                                     .may_hold_volume = may_hold_image,
                                     .describe = parse_vti,
                                     .most_bytes = most_vti_bytes};

}  // namespace isomesh::import
