#include <array>
#include <cmath>
#include <limits>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "base/text.h"
#include "base/xml.h"
#include "server/codec/block_writer.h"
#include "server/codec/encode.h"
#include "server/codec/label_titles.h"
#include "server/codec/number_text.h"
#include "server/codec/provenance_json.h"
#include "server/codec/space.h"
#include "server/codec/zip_writer.h"

namespace isomesh::codec {
namespace {

constexpr std::string_view kXml = "<?xml version=\"1.0\" encoding=\"UTF-8\"?>\n";
constexpr const char* kModelName = "3D/3dmodel.model";

constexpr std::string_view kContentTypes =
    "<Types xmlns=\"http://schemas.openxmlformats.org/package/2006/content-types\">"
    "<Default Extension=\"rels\" "
    "ContentType=\"application/vnd.openxmlformats-package.relationships+xml\"/>"
    "<Default Extension=\"model\" "
    "ContentType=\"application/vnd.ms-package.3dmanufacturing-3dmodel+xml\"/>"
    "</Types>\n";

constexpr std::string_view kRelationships =
    "<Relationships xmlns=\"http://schemas.openxmlformats.org/package/2006/relationships\">"
    "<Relationship Id=\"model\" Target=\"/3D/3dmodel.model\" "
    "Type=\"http://schemas.microsoft.com/3dmanufacturing/2013/01/3dmodel\"/>"
    "</Relationships>\n";

// Bambu Studio and OrcaSlicer find colours by the prefix m, not by its namespace.
constexpr std::string_view kModel =
    "<model unit=\"millimeter\" xml:lang=\"en-US\" "
    "xmlns=\"http://schemas.microsoft.com/3dmanufacturing/core/2015/02\" "
    "xmlns:m=\"http://schemas.microsoft.com/3dmanufacturing/material/2015/02\" "
    "xmlns:isomesh=\"urn:isomesh:mesh\">\n";

constexpr std::string_view kVertex = "<vertex x=\"";
constexpr std::string_view kTriangle = "<triangle v1=\"";
constexpr std::size_t kMostVertexBytes = 40 + 3 * kMostFloatBytes;
constexpr std::size_t kMostTriangleBytes = 40 + 3 * kMostIndexBytes;

std::byte* write_vertex(const mesh::Vec3& position, std::byte* begin) {
  char* out = reinterpret_cast<char*>(begin);
  out = write_number(position[0], write_text(kVertex, out));
  out = write_number(position[1], write_text("\" y=\"", out));
  out = write_number(position[2], write_text("\" z=\"", out));
  return reinterpret_cast<std::byte*>(write_text("\"/>\n", out));
}

std::byte* write_triangle(const mesh::Triangle& triangle, std::byte* begin) {
  char* out = reinterpret_cast<char*>(begin);
  out = write_number(std::uint64_t{triangle[0]}, write_text(kTriangle, out));
  out = write_number(std::uint64_t{triangle[1]}, write_text("\" v2=\"", out));
  out = write_number(std::uint64_t{triangle[2]}, write_text("\" v3=\"", out));
  return reinterpret_cast<std::byte*>(write_text("\"/>\n", out));
}

// With the opacity, because assimp 5.4 shows colours without one as transparent.
std::string hex_color(const std::array<double, 3>& color) {
  constexpr std::string_view kDigits = "0123456789ABCDEF";
  std::string text = "#";
  for (const double channel : color) {
    const auto byte = static_cast<unsigned>(std::lround(channel * 255));
    text += kDigits[byte / 16];
    text += kDigits[byte % 16];
  }
  return text + "FF";
}

std::string in_quotes_of_xml(std::string_view text) { return '"' + xml_escaped(text) + '"'; }

std::string in_quotes_of_xml(std::uint64_t number) { return '"' + std::to_string(number) + '"'; }

// On the coordinates, and on the largest error that was asked for.
std::string about_coordinates(const FileContent& content) {
  std::string text = " Coordinates in " + std::string(letters_of(content.space)) + ", in " +
                     std::string(content.unit.name);
  if (content.unit != length_unit({})) text += ", written as millimetres";
  text += '.';
  if (const auto limit = content.provenance.parameters.max_error_mm) {
    text += " Requested largest error: " + to_text(*limit) + ' ' +
            std::string(content.unit.symbol) + '.';
  }
  return text;
}

struct Heading {
  std::string title;
  std::string description;
};

struct Object {
  std::string name;
  std::string part_number = {};
  std::optional<std::array<double, 3>> color = {};
};

class Package {
 public:
  struct Size {
    std::uint64_t triangles = 0;
    std::uint64_t vertices = 0;
  };

  Package(const Sink& sink, const Size& most, const FileContent& content, const Heading& heading)
      : zip_(sink, kDeflated, sizes_of(most)), space_(content.space), title_(heading.title) {
    add("[Content_Types].xml", kContentTypes);
    add("_rels/.rels", kRelationships);
    zip_.begin(kModelName);
    write(kXml);
    write(kModel);
    write_metadata("Title", xml_escaped(title_));
    write_metadata("Description", xml_escaped(heading.description));
    write_metadata("Application", application());
    write_metadata("isomesh:provenance", provenance_for_xml(content.provenance));
    write("<resources>\n");
  }

  void add_object(const Object& object, const mesh::Mesh& mesh, const mesh::Context& context) {
    std::string attributes = " name=" + in_quotes_of_xml(object.name);
    if (!object.part_number.empty()) {
      attributes += " partnumber=" + in_quotes_of_xml(object.part_number);
    }
    // OrcaSlicer reads one colour of each group only.
    if (object.color) {
      write("<m:colorgroup id=" + in_quotes_of_xml(++last_id_) + "><m:color color=" +
            in_quotes_of_xml(hex_color(*object.color)) + "/></m:colorgroup>\n");
      attributes += " pid=" + in_quotes_of_xml(last_id_) + " pindex=\"0\"";
    }
    begin_object(attributes);
    objects_.push_back(last_id_);
    write("<mesh>\n<vertices>\n");
    BlockWriter writer(context, bytes_, mesh.positions.size() + mesh.triangles.size());
    writer.write(mesh.positions.size(), kMostVertexBytes, [&](std::size_t v, std::byte* out) {
      return write_vertex(in_space(mesh.positions[v], space_), out);
    });
    write("</vertices>\n<triangles>\n");
    writer.write(mesh.triangles.size(), kMostTriangleBytes, [&](std::size_t t, std::byte* out) {
      return write_triangle(mesh.triangles[t], out);
    });
    write("</triangles>\n</mesh>\n</object>\n");
  }

  // Several objects become components of one, which alone is built. Slicers arrange the items of a
  // build one by one.
  void finish() {
    if (objects_.size() > 1) {
      begin_object(" name=" + in_quotes_of_xml(title_));
      write("<components>\n");
      for (const std::uint64_t id : objects_) {
        write("<component objectid=" + in_quotes_of_xml(id) + "/>\n");
      }
      write("</components>\n</object>\n");
    }
    write("</resources>\n<build>\n");
    if (!objects_.empty()) write("<item objectid=" + in_quotes_of_xml(last_id_) + "/>\n");
    write("</build>\n</model>\n");
    zip_.finish();
  }

 private:
  static constexpr auto kDeflated = ZipWriter::Compression::kDeflated;

  // Some readers do not support ZIP64, so it is used only if the package may be large.
  static ZipWriter::Sizes sizes_of(const Size& most) {
    const std::uint64_t most_bytes =
        most.vertices * kMostVertexBytes + most.triangles * kMostTriangleBytes;
    constexpr std::uint64_t kForTheRest = 1U << 30;
    return most_bytes + kForTheRest < std::numeric_limits<std::uint32_t>::max()
               ? ZipWriter::Sizes::kBelow4GiB
               : ZipWriter::Sizes::kAny;
  }

  void add(const std::string& name, std::string_view content) {
    zip_.begin(name);
    write(kXml);
    write(content);
  }
  void write_metadata(const std::string& name, const std::string& content) {
    write("<metadata name=\"" + name + "\">" + content + "</metadata>\n");
  }
  void begin_object(const std::string& attributes) {
    write("<object id=" + in_quotes_of_xml(++last_id_) + " type=\"model\"" + attributes + ">\n");
  }
  void write(std::string_view text) { put_text(bytes_, text); }

  ZipWriter zip_;
  const Space space_;
  const std::string title_;
  const Sink bytes_ = [this](std::span<const std::byte> piece) { zip_.write(piece); };
  std::vector<std::uint64_t> objects_;  // the ids of those with a mesh
  std::uint64_t last_id_ = 0;           // the resources share one series
};

// One label's title, or how many have triangles.
std::string title_of_all(std::span<const LabelSummary> labels,
                         std::span<const mesh::LabelSurface> surfaces) {
  std::size_t count = 0;
  const LabelSummary* last = nullptr;
  for (std::size_t n = 0; n < labels.size(); ++n) {
    if (surfaces[n].triangles.size() == 0) continue;
    ++count;
    last = &labels[n];
  }
  if (last == nullptr) return "no label";
  return count == 1 ? title_of(*last) : std::to_string(count) + " labels";
}

void encode_labels(const LabelledSurface& surface, const FileContent& content,
                   const mesh::Context& context, const Sink& sink) {
  const mesh::Context quiet = {context.stop, nullptr};
  const std::size_t labels = surface.labels.size();
  // Every wall belongs to one or two labels.
  const std::uint64_t walls = surface.walls.mesh.triangles.size();
  const std::string title = title_of_all(surface.labels, surface.surfaces);
  Package package(sink, {2 * walls, 2 * 3 * walls}, content,
                  {title, "The surface of " + title + '.' + about_coordinates(content)});
  for (std::size_t n = 1; n <= labels; ++n) {
    const LabelSummary& label = surface.labels[n - 1];
    const mesh::Mesh& mesh = surface.surfaces[n - 1].mesh;
    if (mesh.triangles.size() > 0) {
      package.add_object({.name = title_of(label),
                          .part_number = std::to_string(label.label),
                          .color = color_of(label)},
                         mesh, quiet);
    }
    if (context.progress) context.progress(static_cast<double>(n) / static_cast<double>(labels));
  }
  package.finish();
}

}  // namespace

std::optional<mesh::Topology> encode_3mf(const FileContent& content, const mesh::Context& context,
                                         const Sink& sink) {
  if (content.labels != nullptr) {
    encode_labels(*content.labels, content, context, sink);
    return std::nullopt;
  }
  const mesh::Mesh& mesh = content.mesh;
  const std::string iso = to_text(content.provenance.iso);
  const bool is_below = content.provenance.parameters.inside == Inside::kBelow;
  const Heading heading = {(is_below ? "below iso " : "iso ") + iso,
                           "The surface at the value " + iso + '.' + about_coordinates(content)};
  Package package(sink, {mesh.triangles.size(), mesh.positions.size()}, content, heading);
  if (mesh.triangles.size() > 0) package.add_object({.name = heading.title}, mesh, context);
  package.finish();
  return std::nullopt;
}

}  // namespace isomesh::codec
