#include "server/codec/encode_labels.h"

#include <algorithm>
#include <array>
#include <charconv>
#include <cmath>
#include <cstring>
#include <string>
#include <string_view>
#include <vector>

#include "server/codec/block_writer.h"
#include "server/codec/faces.h"
#include "server/codec/ply_obj_records.h"

namespace isomesh::codec {
namespace {

constexpr std::size_t kFaceBytes = kPlyFaceBytes + sizeof(std::uint32_t);

// Consecutive labels are a golden section of the hue circle apart.
std::array<double, 3> series_color(std::int64_t label) {
  constexpr double kGoldenSection = 0.6180339887498949;
  constexpr double kSaturation = 0.5;
  constexpr double kValue = 0.9;
  const double turns = static_cast<double>(label) * kGoldenSection;
  const double hue = 6 * (turns - std::floor(turns));
  std::array<double, 3> color;
  for (std::size_t channel = 0; channel < 3; ++channel) {
    // A. R. Smith's hexcone (1978), in the form without case distinctions.
    const double k = std::fmod(5 - 2 * static_cast<double>(channel) + hue, 6);
    color[channel] = kValue * (1 - kSaturation * std::max(0.0, std::min({k, 4 - k, 1.0})));
  }
  return color;
}

}  // namespace

std::string title_of(const LabelSummary& label) {
  return label.name.value_or("label " + std::to_string(label.label));
}

std::array<double, 3> color_of(const LabelSummary& label) {
  if (!label.color || label.color->size() != 7) return series_color(label.label);
  std::array<double, 3> color;
  for (std::size_t channel = 0; channel < 3; ++channel) {
    unsigned byte = 0;
    const char* digits = label.color->data() + 1 + 2 * channel;
    std::from_chars(digits, digits + 2, byte, 16);
    color[channel] = byte / 255.0;
  }
  return color;
}

std::string ObjGroups::of(const LabelSummary& label) {
  std::string title = title_of(label);
  std::ranges::replace_if(
      title, [](char c) { return c == ' ' || c == '\t' || c == '\\'; }, '_');
  std::string group = title;
  for (int more = 0; !taken_.insert(group).second; ++more) {
    group =
        title + '-' + std::to_string(label.label) + (more == 0 ? "" : '-' + std::to_string(more));
  }
  return group;
}

std::string mtl_material(const std::string& group, const LabelSummary& label) {
  std::string text = "newmtl " + group + "\nKd";
  for (const double channel : color_of(label)) {
    std::array<char, 32> number = {};
    text += ' ';
    text.append(
        number.data(),
        std::to_chars(number.begin(), number.end(), channel, std::chars_format::fixed, 6).ptr);
  }
  return text + '\n';
}

double linear_of(double srgb) {
  return srgb <= 0.04045 ? srgb / 12.92 : std::pow((srgb + 0.055) / 1.055, 2.4);
}

void encode_labels_ply(const LabelledSurface& surface, const Frame& frame,
                       const mesh::Context& context, const Sink& sink) {
  context.throw_if_stopped();
  const mesh::Mesh& mesh = surface.walls.mesh;
  const std::vector<FaceRun> runs = faces_of(surface);
  const std::size_t faces = count_of(runs);
  put_text(sink,
           ply_header(frame, mesh.positions.size(), faces,
                      has_wide_labels(surface) ? "property uint label\n" : "property int label\n"));
  BlockWriter writer(context, sink, mesh.positions.size() + faces);
  writer.write(mesh.positions.size(), kPlyVertexBytes, [&](std::size_t v, std::byte* out) {
    return write_ply_vertex(in_space(mesh.positions[v], frame.space), out);
  });
  for (const FaceRun& run : runs) {
    writer.write(run.count, kFaceBytes, [&](std::size_t t, std::byte* out) {
      out = write_ply_face(run.at(t), out);
      std::memcpy(out, &run.label, sizeof run.label);
      return out + sizeof run.label;
    });
  }
}

void encode_labels_obj(const LabelledSurface& surface, const Frame& frame,
                       const mesh::Context& context, const Sink& sink) {
  context.throw_if_stopped();
  const mesh::Mesh& mesh = surface.walls.mesh;
  put_text(sink, obj_header(frame));
  const std::vector<FaceRun> runs = faces_of(surface);
  BlockWriter writer(context, sink, mesh.positions.size() + count_of(runs));
  writer.write(mesh.positions.size(), kMostObjVertexBytes, [&](std::size_t v, std::byte* out) {
    return write_obj_vertex(in_space(mesh.positions[v], frame.space), out);
  });
  ObjGroups groups;
  for (std::size_t n = 0; n < runs.size(); ++n) {
    const std::string group = groups.of(surface.labels[n]);
    put_text(sink, "g " + group + "\nusemtl " + group + '\n');
    writer.write(runs[n].count, kMostObjFaceBytes,
                 [&](std::size_t t, std::byte* out) { return write_obj_face(runs[n].at(t), out); });
  }
}

}  // namespace isomesh::codec
