#include "server/codec/draco/stream.h"

#include <algorithm>
#include <string_view>

#include "server/codec/draco/bytes.h"
#include "server/codec/draco/encoder.h"
#include "server/codec/draco/rans.h"

namespace isomesh::codec::edgebreaker {
namespace {

// From the bitstream's specification.
constexpr std::string_view kMagic = "DRACO";
constexpr std::uint32_t kMajorVersion = 2;
constexpr std::uint32_t kMinorVersion = 2;
constexpr std::uint32_t kTriangularMesh = 1;
constexpr std::uint32_t kEdgebreaker = 1;
constexpr std::uint32_t kStandardEdgebreaker = 0;
constexpr std::uint32_t kPositionConnectivity = 0xFF;
constexpr std::uint32_t kValuePerVertex = 0;
constexpr std::uint32_t kDepthFirst = 0;
constexpr std::uint32_t kPositionAttribute = 0;
constexpr std::uint32_t kNormalAttribute = 1;
constexpr std::uint32_t kFloat32 = 9;
constexpr std::uint32_t kQuantised = 2;
constexpr std::uint32_t kOctahedral = 3;
constexpr std::uint32_t kDifference = 0;
constexpr std::uint32_t kParallelogram = 1;
constexpr std::uint32_t kWrapTransform = 1;
constexpr std::uint32_t kOctahedralTransform = 3;
constexpr std::uint32_t kCompressed = 1;

void write_events(const std::vector<SplitEvent>& events, ByteWriter& out) {
  out.varint(events.size());
  std::uint32_t last = 0;
  for (const SplitEvent& event : events) {
    out.varint(event.source - last);
    out.varint(event.source - event.split);
    last = event.source;
  }
  for (std::size_t i = 0; i < events.size(); i += 8) {
    std::uint32_t sides = 0;
    for (std::size_t bit = 0; bit < std::min<std::size_t>(8, events.size() - i); ++bit) {
      sides |= std::uint32_t{events[i + bit].side} << bit;
    }
    out.byte(sides);
  }
}

// Three bits per symbol, one for C.
void write_symbols(std::span<const std::uint8_t> symbols, ByteWriter& out) {
  std::size_t bits = 0;
  for (const std::uint8_t symbol : symbols) bits += 1 + 2 * (symbol & 1U);
  const std::size_t bytes = BitWriter::bytes_of(bits);
  out.varint(bytes);
  BitWriter writer(out.extend(bytes));
  // The decoder reads the symbols backwards.
  for (std::size_t i = symbols.size(); i-- > 0;) {
    writer.put(symbols[i], 1 + 2 * (symbols[i] & 1U));
  }
  writer.finish();
}

void write_attribute(std::uint32_t kind, std::uint32_t id, ByteWriter& out) {
  for (const std::uint32_t byte : {kind, kFloat32, 3U, 0U}) out.byte(byte);
  out.varint(id);
}

}  // namespace

std::vector<std::byte> assemble(const StreamParts& parts) {
  ByteWriter out;
  constexpr std::size_t kUsualRest = 4096;
  constexpr std::size_t kUsualEvent = 6;
  out.reserve(parts.residuals.head.size() + parts.residuals.data.size() +
              (parts.normals ? parts.normals->data.size() : 0) +
              parts.traversal.symbols().size() * 3 / 8 +
              kUsualEvent * parts.traversal.events().size() + kUsualRest);
  out.append(std::as_bytes(std::span(kMagic)));
  for (const std::uint32_t byte : {kMajorVersion, kMinorVersion, kTriangularMesh, kEdgebreaker}) {
    out.byte(byte);
  }
  out.raw(std::uint16_t{0});  // flags: no metadata
  out.byte(kStandardEdgebreaker);
  out.varint(parts.vertices);
  out.varint(parts.faces);
  out.byte(0);  // attributes with seams of their own
  out.varint(parts.traversal.symbols().size());
  out.varint(parts.traversal.splits());
  write_events(parts.traversal.events(), out);
  write_symbols(parts.traversal.symbols(), out);
  write_bits(parts.traversal.inner_first_faces(), out);

  out.byte(1);  // decoders of attributes
  for (const std::uint32_t byte : {kPositionConnectivity, kValuePerVertex, kDepthFirst}) {
    out.byte(byte);
  }
  out.varint(parts.normals ? 2 : 1);  // attributes of that decoder
  write_attribute(kPositionAttribute, kPositionId, out);
  if (parts.normals) write_attribute(kNormalAttribute, kNormalId, out);
  out.byte(kQuantised);
  if (parts.normals) out.byte(kOctahedral);
  for (const std::uint32_t byte : {kParallelogram, kWrapTransform, kCompressed}) out.byte(byte);
  out.append(parts.residuals.head);
  out.append(parts.residuals.data);
  out.raw(parts.extent.least);
  out.raw(parts.extent.greatest);
  if (parts.normals) {
    constexpr std::int32_t kGreatest = (1 << kNormalBits) - 1;
    for (const std::uint32_t byte : {kDifference, kOctahedralTransform, kCompressed}) {
      out.byte(byte);
    }
    out.append(parts.normals->head);
    out.append(parts.normals->data);
    out.raw(kGreatest);
    out.raw((kGreatest - 1) / 2);  // the middle of the square
  }
  for (const float low : parts.grid.low) out.raw(low);
  out.raw(parts.grid.side);
  out.byte(static_cast<std::uint32_t>(parts.grid.bits));
  if (parts.normals) out.byte(static_cast<std::uint32_t>(kNormalBits));
  return out.take();
}

}  // namespace isomesh::codec::edgebreaker
