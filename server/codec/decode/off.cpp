#include <string>
#include <vector>

#include "server/codec/decode/formats.h"
#include "server/codec/decode/lines.h"
#include "server/mesh/parallel.h"

namespace isomesh::codec::decoding {
namespace {

constexpr MeshFormat kFormat = MeshFormat::kOff;

// Takes the next line off the text, without its end.
std::string_view next_line(std::string_view& text) {
  const std::size_t end = text.find('\n');
  if (end == std::string_view::npos) refuse(kFormat, "it ends within its header");
  const std::string_view line = text.substr(0, end);
  text.remove_prefix(end + 1);
  return line;
}

struct Counts {
  std::size_t vertices = 0;
  std::size_t faces = 0;
};

Counts read_head(std::string_view& text) {
  if (next_line(text) != "OFF") refuse(kFormat, "it does not begin with OFF");
  std::string_view line = next_line(text);
  while (line.starts_with('#')) line = next_line(text);
  const auto [vertices, faces, edges] = numbers_of<std::uint32_t, 3>(line, kFormat);
  return {vertices, faces};
}

mesh::Triangle triangle_of(std::string_view line) {
  const auto [corners, a, b, c] = numbers_of<std::uint32_t, 4>(line, kFormat);
  if (corners != 3) refuse(kFormat, "a face is not a triangle");
  return {a, b, c};
}

}  // namespace

DecodedSurface decode_off(Bytes file, const mesh::Context& context) {
  const mesh::Context quiet = {context.stop, nullptr};
  std::string_view text = as_text(file);
  const Counts counts = read_head(text);
  if (!text.empty() && text.back() != '\n') refuse(kFormat, "its last line does not end");
  const std::vector<std::string_view> pieces = cut_lines(text);
  std::vector<std::size_t> lines(pieces.size());
  mesh::parallel_for(quiet, pieces.size(), [&](std::size_t n) {
    lines[n] = static_cast<std::size_t>(std::ranges::count(pieces[n], '\n'));
  });
  std::vector<std::size_t> begins = {0};
  for (const std::size_t count : lines) begins.push_back(begins.back() + count);
  if (begins.back() != counts.vertices + counts.faces) {
    refuse(kFormat, "its " + std::to_string(begins.back()) + " lines are not " +
                        std::to_string(counts.vertices) + " vertices and " +
                        std::to_string(counts.faces) + " faces");
  }
  DecodedSurface surface;
  surface.positions.resize_for_overwrite(counts.vertices);
  surface.triangles.resize_for_overwrite(counts.faces);
  mesh::parallel_for(quiet, pieces.size(), [&](std::size_t n) {
    std::size_t at = begins[n];
    for_each_line(pieces[n], [&](std::string_view line) {
      if (at < counts.vertices) {
        surface.positions[at] = numbers_of<float, 3>(line, kFormat);
      } else {
        surface.triangles[at - counts.vertices] = triangle_of(line);
      }
      ++at;
    });
  });
  return surface;
}

}  // namespace isomesh::codec::decoding
