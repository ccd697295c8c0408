#include <algorithm>
#include <bit>
#include <cmath>
#include <cstring>
#include <limits>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "base/mutex.h"
#include "server/codec/block_writer.h"
#include "server/codec/encode.h"
#include "server/codec/space.h"
#include "server/codec/walked_file.h"
#include "server/mesh/parallel.h"
#include "server/mesh/points.h"

namespace isomesh::codec {
namespace {

static_assert(std::endian::native == std::endian::little, "STL is little-endian");

constexpr std::size_t kHeaderBytes = 80;
constexpr std::size_t kFacetBytes = 50;

mesh::Vec3 unit_normal(const mesh::Vec3& a, const mesh::Vec3& b, const mesh::Vec3& c) {
  const mesh::Point n = mesh::normal_of(mesh::to_point(a), mesh::to_point(b), mesh::to_point(c));
  const double length = std::sqrt(mesh::dot(n, n));
  const double scale = length > 0 ? 1 / length : 0;
  return {static_cast<float>(n[0] * scale), static_cast<float>(n[1] * scale),
          static_cast<float>(n[2] * scale)};
}

void write_facet(const mesh::Mesh& mesh, Space space, const mesh::Triangle& triangle,
                 std::byte* out) {
  const mesh::Vec3 a = in_space(mesh.positions[triangle[0]], space);
  const mesh::Vec3 b = in_space(mesh.positions[triangle[1]], space);
  const mesh::Vec3 c = in_space(mesh.positions[triangle[2]], space);
  for (const mesh::Vec3& vector : {unit_normal(a, b, c), a, b, c}) {
    std::memcpy(out, vector.data(), sizeof vector);
    out += sizeof vector;
  }
  std::memset(out, 0, 2);  // attribute byte count
}

std::vector<std::byte> head_of(Space space, const LengthUnit& unit, std::uint64_t triangles) {
  if (triangles > std::numeric_limits<std::uint32_t>::max()) {
    throw Error(ErrorCode::kTooLarge,
                "The surface has more triangles than an STL file can hold. Set \"triangles\" to "
                "simplify it.");
  }
  // The header must not start with "solid": readers would assume a text file.
  const std::string title = "isomesh binary STL, " + unit_and_space(unit, space);
  std::vector<std::byte> head(kHeaderBytes + 4);
  std::memcpy(head.data(), title.data(), title.size());
  const auto count = static_cast<std::uint32_t>(triangles);
  std::memcpy(head.data() + kHeaderBytes, &count, sizeof count);
  return head;
}

std::byte* write_facets(const mesh::Mesh& mesh, Space space, std::size_t begin, std::size_t end,
                        std::byte* out) {
  for (std::size_t t = begin; t < end; ++t, out += kFacetBytes) {
    write_facet(mesh, space, mesh.triangles[t], out);
  }
  return out;
}

class WalkedStl : public WalkedFile {
 public:
  explicit WalkedStl(const WalkedContent& content)
      : space_(space_of(content.format, content.provenance.parameters)), sink_(content.sink) {
    sink_(head_of(space_, length_unit(content.provenance.notes), content.size.triangles));
  }

  std::size_t parts(const mesh::Window& window) const override {
    return mesh::chunks_of(window.mesh.triangles.size(), kTrianglesPerPart);
  }

  mesh::WindowUser::InOrder work(const mesh::Window& window, std::size_t part) override {
    const std::size_t begin = part * kTrianglesPerPart;
    const std::size_t end = std::min(window.mesh.triangles.size(), begin + kTrianglesPerPart);
    const auto bytes = std::make_shared<std::vector<std::byte>>(take());
    bytes->resize((end - begin) * kFacetBytes);
    write_facets(window.mesh, space_, begin, end, bytes->data());
    return [this, bytes] {
      sink_(*bytes);
      give_back(std::move(*bytes));
    };
  }

 private:
  static constexpr std::size_t kTrianglesPerPart = 1 << 15;

  // Bytes are used again, so that their pages stay mapped.
  std::vector<std::byte> take() {
    const Lock lock(mutex_);
    if (idle_.empty()) return {};
    std::vector<std::byte> bytes = std::move(idle_.back());
    idle_.pop_back();
    return bytes;
  }
  void give_back(std::vector<std::byte> bytes) {
    const Lock lock(mutex_);
    idle_.push_back(std::move(bytes));
  }

  const Space space_;
  const Sink& sink_;
  Mutex mutex_;
  std::vector<std::vector<std::byte>> idle_ ISOMESH_GUARDED_BY(mutex_);
};

}  // namespace

std::unique_ptr<WalkedFile> walked_stl(const WalkedContent& content) {
  return std::make_unique<WalkedStl>(content);
}

std::optional<mesh::Topology> encode_stl(const FileContent& content, const mesh::Context& context,
                                         const Sink& sink) {
  const mesh::Mesh& mesh = content.mesh;
  const std::size_t triangles = mesh.triangles.size();
  sink(head_of(content.space, content.unit, triangles));
  BlockWriter(context, sink, triangles)
      .write(triangles, kFacetBytes, [&](std::size_t t, std::byte* out) {
        return write_facets(mesh, content.space, t, t + 1, out);
      });
  return std::nullopt;
}

}  // namespace isomesh::codec
