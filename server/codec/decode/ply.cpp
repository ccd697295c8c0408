#include <charconv>
#include <cstring>

#include "server/codec/decode/formats.h"
#include "server/mesh/parallel.h"

namespace isomesh::codec::decoding {
namespace {

constexpr std::size_t kElementsPerTask = std::size_t{1} << 16;
constexpr std::size_t kVertexBytes = sizeof(mesh::Vec3);

struct Layout {
  std::size_t vertices = 0;
  std::size_t faces = 0;
  std::size_t face_bytes = 1 + sizeof(mesh::Triangle);
  std::size_t body = 0;  // where it begins
};

// The lines of a header, each to be what is expected.
class Header {
 public:
  explicit Header(Bytes file) : text_(as_text(file)) { next(); }

  bool is(std::string_view line) {
    if (line_ != line) return false;
    next();
    return true;
  }

  void expect(std::string_view line) {
    if (!is(line)) refuse_line("\"" + std::string(line) + "\"");
  }

  // Behind the words of `before`.
  std::size_t expect_count(std::string_view before) {
    std::size_t count = 0;
    const std::string_view number = line_.starts_with(before) ? line_.substr(before.size()) : "";
    const auto [end, error] = std::from_chars(number.data(), number.data() + number.size(), count);
    if (number.empty() || error != std::errc{} || end != number.data() + number.size()) {
      refuse_line("\"" + std::string(before) + "\" and a number");
    }
    next();
    return count;
  }

  void skip_comments() {
    while (line_.starts_with("comment ")) next();
  }

  // Of the line that was read last.
  std::size_t end() const { return at_; }
  void expect_end() {
    if (line_ != "end_header") refuse_line("\"end_header\"");
  }

 private:
  void next() {
    const std::size_t end = text_.find('\n', at_);
    if (end == std::string_view::npos) refuse(MeshFormat::kPly, "its header has no end");
    line_ = text_.substr(at_, end - at_);
    at_ = end + 1;
    ++number_;
  }

  [[noreturn]] void refuse_line(const std::string& expected) const {
    refuse(MeshFormat::kPly,
           "line " + std::to_string(number_) + " of its header is not " + expected);
  }

  std::string_view text_;
  std::string_view line_;
  std::size_t at_ = 0;
  int number_ = 0;
};

Layout read_header(Bytes file) {
  Header header(file);
  Layout layout;
  header.expect("ply");
  header.expect("format binary_little_endian 1.0");
  header.skip_comments();
  layout.vertices = header.expect_count("element vertex ");
  for (const char* axis : {"x", "y", "z"}) header.expect(std::string("property float ") + axis);
  layout.faces = header.expect_count("element face ");
  header.expect("property list uchar uint vertex_indices");
  if (header.is("property int label") || header.is("property uint label")) {
    layout.face_bytes += sizeof(std::uint32_t);
  }
  header.expect_end();
  layout.body = header.end();
  return layout;
}

}  // namespace

DecodedSurface decode_ply(Bytes file, const mesh::Context& context) {
  const Layout layout = read_header(file);
  const std::size_t rest = file.size() - layout.body;
  if (layout.vertices > rest / kVertexBytes || layout.faces > rest / layout.face_bytes ||
      rest != layout.vertices * kVertexBytes + layout.faces * layout.face_bytes) {
    refuse(MeshFormat::kPly, "the " + std::to_string(rest) + " bytes after its header are not " +
                                 std::to_string(layout.vertices) + " vertices and " +
                                 std::to_string(layout.faces) + " faces");
  }
  DecodedSurface surface;
  surface.positions.resize_for_overwrite(layout.vertices);
  surface.triangles.resize_for_overwrite(layout.faces);
  const Bytes vertices = file.subspan(layout.body, layout.vertices * kVertexBytes);
  const Bytes faces = file.subspan(layout.body + vertices.size());
  if (!vertices.empty()) {
    std::memcpy(surface.positions.data(), vertices.data(), vertices.size());
  }
  const std::size_t tasks = tasks_of(layout.faces, kElementsPerTask);
  mesh::parallel_for({context.stop, nullptr}, tasks, [&](std::size_t task) {
    const std::size_t end = std::min(layout.faces, (task + 1) * kElementsPerTask);
    for (std::size_t t = task * kElementsPerTask; t < end; ++t) {
      const std::size_t face = t * layout.face_bytes;
      if (faces[face] != std::byte{3}) {
        refuse(MeshFormat::kPly, "face " + std::to_string(t) + " is not a triangle");
      }
      surface.triangles[t] = value_at<mesh::Triangle>(faces, face + 1);
    }
  });
  return surface;
}

}  // namespace isomesh::codec::decoding
