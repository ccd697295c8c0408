#include <array>
#include <cmath>
#include <limits>
#include <string>
#include <string_view>

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

std::string hex_color(const std::array<double, 3>& color) {
  constexpr std::string_view kDigits = "0123456789ABCDEF";
  std::string text = "#";
  for (const double channel : color) {
    const auto byte = static_cast<unsigned>(std::lround(channel * 255));
    text += kDigits[byte / 16];
    text += kDigits[byte % 16];
  }
  return text;
}

struct Object {
  std::string name;
  std::string part_number;
  std::size_t material = 0;
  bool is_solid = false;
};

class Package {
 public:
  struct Size {
    std::uint64_t triangles = 0;
    std::uint64_t vertices = 0;
  };

  Package(const Sink& sink, const Size& most, Space space)
      : zip_(sink, kDeflated, sizes_of(most)), space_(space) {
    add("[Content_Types].xml", kContentTypes);
    add("_rels/.rels", kRelationships);
    zip_.begin(kModelName);
  }

  void begin_model(const std::string& title, const Provenance& provenance) {
    write(kXml);
    write(
        "<model unit=\"millimeter\" xml:lang=\"en-US\" "
        "xmlns=\"http://schemas.microsoft.com/3dmanufacturing/core/2015/02\" "
        "xmlns:isomesh=\"urn:isomesh:mesh\">\n");
    write("<metadata name=\"Title\">" + xml_escaped(title) + "</metadata>\n");
    write("<metadata name=\"Application\">isomesh</metadata>\n");
    write("<metadata name=\"isomesh:provenance\">" + provenance_for_xml(provenance) +
          "</metadata>\n<resources>\n");
  }

  void begin_materials() { write("<basematerials id=\"" + std::to_string(kMaterialsId) + "\">\n"); }
  void add_material(const std::string& name, const std::array<double, 3>& color) {
    write("<base name=\"" + xml_escaped(name) + "\" displaycolor=\"" + hex_color(color) + "\"/>\n");
  }
  void end_materials() { write("</basematerials>\n"); }

  void add_object(const Object& object, const mesh::Mesh& mesh, const mesh::Context& context) {
    const std::string id = std::to_string(kMaterialsId + 1 + objects_);
    ++objects_;
    write("<object id=\"" + id + "\" type=\"" + (object.is_solid ? "model" : "surface") +
          "\" name=\"" + xml_escaped(object.name) + '"' +
          (object.part_number.empty() ? "" : " partnumber=\"" + object.part_number + '"') +
          " pid=\"" + std::to_string(kMaterialsId) + "\" pindex=\"" +
          std::to_string(object.material) + "\">\n<mesh>\n<vertices>\n");
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

  void finish() {
    write("</resources>\n<build>\n");
    for (std::size_t n = 1; n <= objects_; ++n) {
      write("<item objectid=\"" + std::to_string(kMaterialsId + n) + "\"/>\n");
    }
    write("</build>\n</model>\n");
    zip_.finish();
  }

 private:
  static constexpr auto kDeflated = ZipWriter::Compression::kDeflated;
  static constexpr std::size_t kMaterialsId = 1;

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
  void write(std::string_view text) { put_text(bytes_, text); }

  ZipWriter zip_;
  const Space space_;
  const Sink bytes_ = [this](std::span<const std::byte> piece) { zip_.write(piece); };
  std::size_t objects_ = 0;
};

bool is_solid(const mesh::Topology& topology) {
  return topology.boundary_edges == 0 && topology.manifold && topology.oriented;
}

void encode_labels(const LabelledSurface& surface, const FileContent& content,
                   const mesh::Context& context, const Sink& sink) {
  const mesh::Context quiet = {context.stop, nullptr};
  const std::size_t labels = surface.labels.size();
  // Every wall belongs to one or two labels.
  const std::uint64_t walls = surface.walls.mesh.triangles.size();
  Package package(sink, {2 * walls, 2 * 3 * walls}, content.space);
  package.begin_model("labels", content.provenance);
  if (labels > 0) {
    package.begin_materials();
    for (const LabelSummary& label : surface.labels) {
      package.add_material(title_of(label), color_of(label));
    }
    package.end_materials();
  }
  mesh::Mesh mesh;
  for (std::size_t n = 1; n <= labels; ++n) {
    const LabelSummary& label = surface.labels[n - 1];
    if (!surface.triangles.of(n).empty()) {
      extract_label(surface.walls, surface.triangles, n, mesh);
      package.add_object({.name = title_of(label),
                          .part_number = std::to_string(label.label),
                          .material = n - 1,
                          .is_solid = label.closed && label.manifold && label.oriented},
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
  const mesh::Topology topology = measure_topology(mesh, {context.stop, nullptr});
  Package package(sink, {mesh.triangles.size(), mesh.positions.size()}, content.space);
  package.begin_model("surface", content.provenance);
  if (mesh.triangles.size() > 0) {
    constexpr std::array<double, 3> kNeutral = {0.9, 0.9, 0.9};
    package.begin_materials();
    package.add_material("neutral", kNeutral);
    package.end_materials();
    package.add_object({.name = "surface", .part_number = {}, .is_solid = is_solid(topology)}, mesh,
                       context);
  }
  package.finish();
  return topology;
}

}  // namespace isomesh::codec
