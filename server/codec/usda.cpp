#include <algorithm>
#include <array>
#include <functional>
#include <set>
#include <span>
#include <string>
#include <string_view>
#include <utility>

#include "base/text.h"
#include "proto/parameters.h"
#include "server/codec/block_writer.h"
#include "server/codec/encode.h"
#include "server/codec/faces.h"
#include "server/codec/label_titles.h"
#include "server/codec/number_text.h"
#include "server/codec/provenance_json.h"
#include "server/mesh/measure/normals.h"

namespace isomesh::codec {
namespace {

constexpr std::size_t kMostSeparatorBytes = 2;
constexpr std::size_t kMostVectorBytes = 6 + kMostSeparatorBytes + 3 * kMostFloatBytes;
constexpr std::size_t kMostCountBytes = 1 + kMostSeparatorBytes;
constexpr std::size_t kMostTripleBytes = 3 * (kMostIndexBytes + kMostSeparatorBytes);

// LPS to Y up: the head points along y, the front of the patient along z.
mesh::Vec3 with_y_up(const mesh::Vec3& lps) {
  return {lps[0], lps[2], 0 - lps[1]};  // avoids negative zeros
}

// Elements of an array follow a comma, except the first. Arrays are one line: some readers, such as
// that of three.js, expect it.
char* separate(std::size_t index, char* out) { return index == 0 ? out : write_text(", ", out); }

char* write_vector(const mesh::Vec3& vector, char* out) {
  out = write_number(vector[0], write_text("(", out));
  out = write_number(vector[1], write_text(", ", out));
  out = write_number(vector[2], write_text(", ", out));
  return write_text(")", out);
}

std::string vector_text(const mesh::Vec3& vector) {
  std::array<char, kMostVectorBytes> text;
  return {text.data(), write_vector(vector, text.data())};
}

std::string usd_string(std::string_view text) {
  std::string result = "\"";
  for (const char c : text) {
    if (c == '"' || c == '\\') result += '\\';
    result += static_cast<unsigned char>(c) < ' ' ? ' ' : c;
  }
  return result + '"';
}

std::string material_of(const std::string& prim) { return prim + "_material"; }

std::string digits_of(std::int64_t label) {
  const std::string text = std::to_string(label);
  return label < 0 ? text.substr(1) : text;
}

// A unique identifier in ASCII: other names need a reader of USD 24.03 or later. So is the name of
// its material, which stands beside it.
std::string prim_of(const LabelSummary& label, std::set<std::string>& taken) {
  std::string title = title_of(label);
  std::ranges::replace_if(title, std::not_fn(is_letter_or_digit), '_');
  if (title.empty() || (title[0] >= '0' && title[0] <= '9')) title.insert(0, 1, '_');
  std::string prim = title;
  for (int more = 0; taken.contains(prim) || taken.contains(material_of(prim)); ++more) {
    prim = title + '_' + digits_of(label.label) + (more == 0 ? "" : '_' + std::to_string(more));
  }
  taken.insert({prim, material_of(prim)});
  return prim;
}

struct MeshPrim {
  std::string prim;
  std::string metadata;         // lines
  std::array<double, 3> color;  // sRGB
};

class Stage {
 public:
  Stage(const FileContent& content, const Sink& sink)
      : format_(content.format), has_normals_(content.provenance.parameters.normals), sink_(sink) {
    const Provenance& provenance = content.provenance;
    write("#usda 1.0\n(\n    customLayerData = {\n        string \"isomesh:provenance\" = " +
          usd_string(provenance_text(provenance)) +
          "\n    }\n    defaultPrim = \"isomesh\"\n    metersPerUnit = " +
          number_text(length_unit(provenance.notes).metres) +
          "\n"
          "    upAxis = \"Y\"\n)\n\ndef Xform \"isomesh\" (\n    kind = \"component\"\n)\n{\n");
  }

  // `normals`: empty if they are not others than the mesh's.
  void add(const MeshPrim& object, const mesh::Mesh& mesh, mesh::Buffer<mesh::Vec3> normals,
           const mesh::Context& context) {
    check_signed_indices(mesh.positions.size(), mesh.triangles.size(), format_);
    if (has_normals_ && normals.size() == 0) vertex_normals(mesh, {context.stop, nullptr}, normals);
    std::array<float, 3> linear;
    std::ranges::transform(object.color, linear.begin(),
                           [](double channel) { return static_cast<float>(linear_of(channel)); });
    const std::string color = vector_text(linear);
    write_material(material_of(object.prim), color);
    write("    def Mesh \"" + object.prim + "\" (\n" + object.metadata +
          "        prepend apiSchemas = [\"MaterialBindingAPI\"]\n    )\n    {\n"
          "        uniform token subdivisionScheme = \"none\"\n"
          "        rel material:binding = </isomesh/" +
          material_of(object.prim) + ">\n        color3f[] primvars:displayColor = [" + color +
          "]\n        float3[] extent = " + extent_of(mesh) + '\n');
    write_arrays(mesh, std::as_const(normals).span(), context);
    write("    }\n\n");
  }

  void finish() { write("}\n"); }

 private:
  void write(std::string_view text) { put_text(sink_, text); }

  // Renderers for phones ignore displayColor.
  void write_material(const std::string& name, const std::string& color) {
    write("    def Material \"" + name +
          "\"\n    {\n        token outputs:surface.connect = </isomesh/" + name +
          "/shader.outputs:surface>\n\n        def Shader \"shader\"\n        {\n"
          "            uniform token info:id = \"UsdPreviewSurface\"\n"
          "            color3f inputs:diffuseColor = " +
          color +
          "\n            float inputs:metallic = 0\n            float inputs:roughness = 0.6\n"
          "            token outputs:surface\n        }\n    }\n\n");
  }

  // The mesh is not empty.
  static std::string extent_of(const mesh::Mesh& mesh) {
    mesh::Vec3 low = with_y_up(mesh.positions[0]);
    mesh::Vec3 high = low;
    for (const mesh::Vec3& position : mesh.positions) {
      const mesh::Vec3 at = with_y_up(position);
      for (std::size_t axis = 0; axis < 3; ++axis) {
        low[axis] = std::min(low[axis], at[axis]);
        high[axis] = std::max(high[axis], at[axis]);
      }
    }
    return '[' + vector_text(low) + ", " + vector_text(high) + ']';
  }

  void write_arrays(const mesh::Mesh& mesh, std::span<const mesh::Vec3> normals,
                    const mesh::Context& context) {
    const std::size_t vertices = mesh.positions.size();
    const std::size_t faces = mesh.triangles.size();
    BlockWriter writer(context, sink_, vertices + normals.size() + 2 * faces);
    const auto vectors = [&](const auto& all) {
      writer.write(all.size(), kMostVectorBytes, [&](std::size_t v, std::byte* out) {
        char* const text = separate(v, reinterpret_cast<char*>(out));
        return reinterpret_cast<std::byte*>(write_vector(with_y_up(all[v]), text));
      });
    };
    write("        point3f[] points = [");
    vectors(mesh.positions);
    if (!normals.empty()) {
      write("]\n        normal3f[] normals = [");
      vectors(normals);
      write("] (\n            interpolation = \"vertex\"\n        )\n");
    } else {
      write("]\n");
    }
    write("        int[] faceVertexCounts = [");
    writer.write(faces, kMostCountBytes, [](std::size_t t, std::byte* out) {
      char* const text = write_text(t == 0 ? "3" : ",3", reinterpret_cast<char*>(out));
      return reinterpret_cast<std::byte*>(text);
    });
    write("]\n        int[] faceVertexIndices = [");
    writer.write(faces, kMostTripleBytes, [&](std::size_t t, std::byte* out) {
      char* text = separate(t, reinterpret_cast<char*>(out));
      const auto& [a, b, c] = mesh.triangles[t];
      text = write_text(",", write_number(std::uint64_t{a}, text));
      text = write_text(",", write_number(std::uint64_t{b}, text));
      return reinterpret_cast<std::byte*>(write_number(std::uint64_t{c}, text));
    });
    write("]\n");
  }

  const MeshFormat format_;
  const bool has_normals_;
  const Sink& sink_;
};

void add_labels(const LabelledSurface& surface, bool has_normals, const mesh::Context& context,
                Stage& stage) {
  const mesh::Context quiet = {context.stop, nullptr};
  const std::size_t labels = surface.labels.size();
  std::set<std::string> prims;
  for (std::size_t n = 1; n <= labels; ++n) {
    const LabelSummary& label = surface.labels[n - 1];
    const mesh::LabelSurface& own = surface.surfaces[n - 1];
    if (own.triangles.size() > 0) {
      mesh::Buffer<mesh::Vec3> normals;
      if (has_normals) normals = shading_of(own, surface.walls, quiet);
      const std::string metadata =
          "        customData = {\n            int64 label = " + std::to_string(label.label) +
          "\n        }\n        displayName = " + usd_string(title_of(label)) + '\n';
      stage.add({prim_of(label, prims), metadata, color_of(label)}, own.mesh, std::move(normals),
                quiet);
    }
    if (context.progress) context.progress(static_cast<double>(n) / static_cast<double>(labels));
  }
}

}  // namespace

std::optional<mesh::Topology> encode_usda(const FileContent& content, const mesh::Context& context,
                                          const Sink& sink) {
  context.throw_if_stopped();
  Stage stage(content, sink);
  if (content.labels != nullptr) {
    add_labels(*content.labels, content.provenance.parameters.normals, context, stage);
  } else if (content.mesh.triangles.size() > 0) {
    constexpr std::array<double, 3> kNeutral = {0.863, 0.839, 0.784};
    stage.add({"surface", "", kNeutral}, content.mesh, {}, context);
  }
  stage.finish();
  return std::nullopt;
}

}  // namespace isomesh::codec
