#include <bit>
#include <string>

#include "server/codec/decode/formats.h"
#include "server/codec/decode/lines.h"
#include "server/mesh/parallel.h"

namespace isomesh::codec::decoding {
namespace {

constexpr std::size_t kElementsPerTask = std::size_t{1} << 16;
constexpr std::size_t kFaceBytes = sizeof(std::uint32_t) + sizeof(mesh::Triangle);

[[noreturn]] void refuse_vtk(const std::string& why) { refuse(MeshFormat::kVtk, why); }

// Takes lines, and data between them, off the front of the file.
class Reader {
 public:
  explicit Reader(Bytes file) : rest_(file) {}

  bool empty() const { return rest_.empty(); }

  std::string_view line() {
    const std::string_view text = as_text(rest_);
    const std::size_t end = text.find('\n');
    if (end == std::string_view::npos) refuse_vtk("it ends within a line");
    rest_ = rest_.subspan(end + 1);
    return text.substr(0, end);
  }

  // What stands between the two in the next line.
  std::string_view between(std::string_view before, std::string_view behind) {
    const std::string_view text = line();
    if (!text.starts_with(before) || !text.ends_with(behind) ||
        text.size() < before.size() + behind.size()) {
      refuse_vtk("a line is not \"" + std::string(before) + "..." + std::string(behind) + '"');
    }
    return text.substr(before.size(), text.size() - before.size() - behind.size());
  }

  void expect(std::string_view expected) { between(expected, ""); }

  // So many elements, and the end of a line behind them.
  Bytes data(std::size_t count, std::size_t element_bytes) {
    if (count > rest_.size() / element_bytes) refuse_vtk("it ends within its data");
    const Bytes data = rest_.first(count * element_bytes);
    rest_ = rest_.subspan(data.size());
    if (!line().empty()) refuse_vtk("its data does not end at the expected place");
    return data;
  }

 private:
  Bytes rest_;
};

std::uint32_t word_at(Bytes bytes, std::size_t offset) {
  return __builtin_bswap32(value_at<std::uint32_t>(bytes, offset));
}

// Calls each(n) for [0, count), side by side.
template <class Each>
void for_all(std::size_t count, const mesh::Context& context, const Each& each) {
  const std::size_t tasks = tasks_of(count, kElementsPerTask);
  mesh::parallel_for({context.stop, nullptr}, tasks, [&](std::size_t task) {
    const std::size_t end = std::min(count, (task + 1) * kElementsPerTask);
    for (std::size_t n = task * kElementsPerTask; n < end; ++n) each(n);
  });
}

}  // namespace

DecodedSurface decode_vtk(Bytes file, const mesh::Context& context) {
  Reader reader(file);
  reader.expect("# vtk DataFile Version 3.0");
  reader.line();  // the title
  reader.expect("BINARY");
  reader.expect("DATASET POLYDATA");
  const auto [vertices] =
      numbers_of<std::uint32_t, 1>(reader.between("POINTS ", " float"), MeshFormat::kVtk);
  const Bytes points = reader.data(vertices, sizeof(mesh::Vec3));
  const auto [triangles, numbers] =
      numbers_of<std::uint64_t, 2>(reader.between("POLYGONS ", ""), MeshFormat::kVtk);
  if (numbers != 4 * triangles) refuse_vtk("its faces are not triangles");
  const Bytes faces = reader.data(triangles, kFaceBytes);
  if (!reader.empty()) {
    reader.expect("CELL_DATA ");
    reader.expect("SCALARS label ");
    reader.expect("LOOKUP_TABLE default");
    reader.data(triangles, sizeof(std::uint32_t));
  }
  if (!reader.empty()) refuse_vtk("extra data follows its data");
  DecodedSurface surface;
  surface.positions.resize_for_overwrite(vertices);
  surface.triangles.resize_for_overwrite(triangles);
  for_all(vertices, context, [&](std::size_t v) {
    for (std::size_t axis = 0; axis < 3; ++axis) {
      surface.positions[v][axis] =
          std::bit_cast<float>(word_at(points, v * sizeof(mesh::Vec3) + axis * sizeof(float)));
    }
  });
  for_all(triangles, context, [&](std::size_t t) {
    if (word_at(faces, t * kFaceBytes) != 3) refuse_vtk("a face is not a triangle");
    for (std::size_t corner = 0; corner < 3; ++corner) {
      surface.triangles[t][corner] =
          word_at(faces, t * kFaceBytes + (corner + 1) * sizeof(std::uint32_t));
    }
  });
  return surface;
}

}  // namespace isomesh::codec::decoding
