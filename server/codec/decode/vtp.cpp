#include <cstring>
#include <string>

#include "server/codec/decode/formats.h"
#include "server/codec/decode/lines.h"
#include "server/codec/decode/xml_elements.h"

namespace isomesh::codec::decoding {
namespace {

[[noreturn]] void refuse_vtp(const std::string& why) { refuse(MeshFormat::kVtp, why); }

// The head's elements, and the data behind it.
class Document {
 public:
  Document(Bytes file, const mesh::Context& context)
      : elements_(elements_of(file, MeshFormat::kVtp, "AppendedData", context)) {
    const XmlElement& root = elements_.front();
    if (root.path != "VTKFile" || value(root, "type") != "PolyData" ||
        value(root, "byte_order") != "LittleEndian" || value(root, "header_type") != "UInt64") {
      refuse_vtp("it is not a little-endian file of VTK's polygonal data");
    }
    const XmlElement& appended = elements_.back();
    if (appended.path != "VTKFile/AppendedData" || value(appended, "encoding") != "raw") {
      refuse_vtp("its data is not appended in raw encoding");
    }
    const std::string_view text = as_text(file);
    const std::size_t mark = text.find('_', appended.begin);
    if (mark == std::string_view::npos) refuse_vtp("its data has no beginning");
    data_ = file.subspan(mark + 1);
  }

  std::size_t count(std::string_view name) const {
    const XmlElement& piece =
        only([](const XmlElement& element) { return element.path == "VTKFile/PolyData/Piece"; });
    return numbers_of<std::uint64_t, 1>(value(piece, name), MeshFormat::kVtp)[0];
  }

  // The array of that name and type, of `count` elements.
  Bytes array(std::string_view name, std::string_view type, std::size_t count,
              std::size_t element_bytes) const {
    const XmlElement& element = only([&](const XmlElement& each) {
      return each.path.ends_with("/DataArray") && value(each, "Name") == name;
    });
    const auto [offset] = numbers_of<std::uint64_t, 1>(value(element, "offset"), MeshFormat::kVtp);
    if (value(element, "type") != type) refuse_vtp("an array is of another type");
    constexpr std::size_t kHeadBytes = sizeof(std::uint64_t);
    if (offset > data_.size() || data_.size() - offset < kHeadBytes) refuse_cut();
    const auto bytes = value_at<std::uint64_t>(data_, offset);
    const Bytes rest = data_.subspan(offset + kHeadBytes);
    if (bytes > rest.size()) refuse_cut();
    if (count > bytes / element_bytes || bytes != count * element_bytes) {
      refuse_vtp("the array " + std::string(name) + " has the wrong size");
    }
    return rest.first(bytes);
  }

  void expect_end(std::size_t end_of_arrays) const {
    constexpr std::string_view kEnd = "\n</AppendedData>\n</VTKFile>\n";
    if (as_text(data_).substr(std::min(end_of_arrays, data_.size())) != kEnd) refuse_cut();
  }

  std::size_t end_of(Bytes array) const {
    return static_cast<std::size_t>(array.data() + array.size() - data_.data());
  }

  bool has_labels() const {
    return std::ranges::any_of(elements_, [](const XmlElement& element) {
      return element.path == "VTKFile/PolyData/Piece/CellData/DataArray";
    });
  }
  std::string_view label_type() const {
    return value(only([](const XmlElement& element) {
                   return element.path == "VTKFile/PolyData/Piece/CellData/DataArray";
                 }),
                 "type");
  }

 private:
  [[noreturn]] static void refuse_cut() { refuse_vtp("it ends too early"); }

  static std::string_view value(const XmlElement& element, std::string_view name) {
    return element.attribute(name, MeshFormat::kVtp);
  }

  template <class Is>
  const XmlElement& only(const Is& is) const {
    if (std::ranges::count_if(elements_, is) != 1) {
      refuse_vtp("an element is missing or occurs twice");
    }
    return *std::ranges::find_if(elements_, is);
  }

  std::vector<XmlElement> elements_;
  Bytes data_;
};

template <class T>
void copy(Bytes from, mesh::Buffer<T>& to) {
  if (!from.empty()) std::memcpy(to.data(), from.data(), from.size());
}

}  // namespace

DecodedSurface decode_vtp(Bytes file, const mesh::Context& context) {
  const Document document(file, context);
  const std::size_t vertices = document.count("NumberOfPoints");
  const std::size_t triangles = document.count("NumberOfPolys");
  const Bytes points = document.array("Points", "Float32", vertices, sizeof(mesh::Vec3));
  const Bytes corners = document.array("connectivity", "Int32", triangles, sizeof(mesh::Triangle));
  const Bytes ends = document.array("offsets", "Int32", triangles, sizeof(std::uint32_t));
  Bytes last = ends;
  if (document.has_labels()) {
    last = document.array("label", document.label_type(), triangles, sizeof(std::uint32_t));
  }
  document.expect_end(document.end_of(last));
  for (std::size_t t = 0; t < triangles; ++t) {
    if (value_at<std::uint32_t>(ends, t * sizeof(std::uint32_t)) != 3 * (t + 1)) {
      refuse_vtp("a face is not a triangle");
    }
  }
  DecodedSurface surface;
  surface.positions.resize_for_overwrite(vertices);
  surface.triangles.resize_for_overwrite(triangles);
  copy(points, surface.positions);
  copy(corners, surface.triangles);
  return surface;
}

}  // namespace isomesh::codec::decoding
