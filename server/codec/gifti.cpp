#include <bit>
#include <string>
#include <string_view>

#include "base/base64.h"
#include "server/codec/block_writer.h"
#include "server/codec/encode.h"
#include "server/codec/faces.h"
#include "server/codec/provenance_json.h"
#include "server/codec/space.h"

namespace isomesh::codec {
namespace {

static_assert(std::endian::native == std::endian::little, "the GIFTI written here is so, too");

// A vertex and a triangle have twelve bytes each: sixteen characters of base64 without padding.
constexpr std::size_t kRecordBytes = 12;
static_assert(sizeof(mesh::Vec3) == kRecordBytes && sizeof(mesh::Triangle) == kRecordBytes);
constexpr std::size_t kRecordText = kRecordBytes / 3 * 4;

template <class Record>
std::byte* write_record(const Record& record, std::byte* out) {
  const auto bytes = std::as_bytes(std::span(&record, 1));
  return reinterpret_cast<std::byte*>(write_base64(bytes, reinterpret_cast<char*>(out)));
}

std::string array_head(std::string_view intent, std::string_view type, std::size_t rows,
                       std::string_view metadata) {
  return "<DataArray Intent=\"" + std::string(intent) + "\" DataType=\"" + std::string(type) +
         "\" ArrayIndexingOrder=\"RowMajorOrder\" Dimensionality=\"2\" Dim0=\"" +
         std::to_string(rows) +
         "\" Dim1=\"3\" Encoding=\"Base64Binary\" Endian=\"LittleEndian\" "
         "ExternalFileName=\"\" ExternalFileOffset=\"\">\n" +
         std::string(metadata);
}

// Connectome Workbench takes a surface without a structure for an invalid one.
constexpr std::string_view kStructure =
    "<MetaData>\n<MD><Name>AnatomicalStructurePrimary</Name><Value>Other</Value></MD>\n"
    "</MetaData>\n";

constexpr std::string_view kCoordinateSystem =
    "<CoordinateSystemTransformMatrix>\n"
    "<DataSpace><![CDATA[NIFTI_XFORM_SCANNER_ANAT]]></DataSpace>\n"
    "<TransformedSpace><![CDATA[NIFTI_XFORM_SCANNER_ANAT]]></TransformedSpace>\n"
    "<MatrixData>\n1 0 0 0\n0 1 0 0\n0 0 1 0\n0 0 0 1\n</MatrixData>\n"
    "</CoordinateSystemTransformMatrix>\n";

}  // namespace

std::optional<mesh::Topology> encode_gii(const FileContent& content, const mesh::Context& context,
                                         const Sink& sink) {
  context.throw_if_stopped();
  const mesh::Mesh& mesh = content.mesh;
  const std::size_t vertices = mesh.positions.size();
  const std::size_t triangles = mesh.triangles.size();
  check_signed_indices(vertices, triangles, content.format);
  // Few readers accept empty arrays.
  const bool is_empty = triangles == 0;
  put_text(sink,
           "<?xml version=\"1.0\" encoding=\"UTF-8\"?>\n"
           "<!DOCTYPE GIFTI SYSTEM \"http://www.nitrc.org/frs/download.php/115/gifti.dtd\">\n"
           "<GIFTI Version=\"1.0\" NumberOfDataArrays=\"" +
               std::string(is_empty ? "0" : "2") +
               "\">\n<MetaData>\n<MD><Name>isomesh:provenance</Name><Value>" +
               provenance_for_xml(content.provenance) +
               "</Value></MD>\n</MetaData>\n<LabelTable/>\n");
  if (is_empty) {
    put_text(sink, "</GIFTI>\n");
    return std::nullopt;
  }
  put_text(sink, array_head("NIFTI_INTENT_POINTSET", "NIFTI_TYPE_FLOAT32", vertices, kStructure) +
                     std::string(kCoordinateSystem) + "<Data>");
  BlockWriter writer(context, sink, vertices + triangles);
  writer.write(vertices, kRecordText + 1, [&](std::size_t v, std::byte* out) {
    return write_record(in_space(mesh.positions[v], content.space), out);
  });
  put_text(sink,
           "</Data>\n</DataArray>\n" +
               array_head("NIFTI_INTENT_TRIANGLE", "NIFTI_TYPE_INT32", triangles, "<MetaData/>\n") +
               "<Data>");
  writer.write(triangles, kRecordText + 1,
               [&](std::size_t t, std::byte* out) { return write_record(mesh.triangles[t], out); });
  put_text(sink, "</Data>\n</DataArray>\n</GIFTI>\n");
  return std::nullopt;
}

}  // namespace isomesh::codec
