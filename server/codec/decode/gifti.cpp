#include <cstring>
#include <string>

#include "base/base64.h"
#include "server/codec/decode/formats.h"
#include "server/codec/decode/lines.h"
#include "server/codec/decode/xml_elements.h"
#include "server/mesh/parallel.h"

namespace isomesh::codec::decoding {
namespace {

constexpr MeshFormat kFormat = MeshFormat::kGii;
constexpr std::size_t kRecordText = 16;
constexpr std::size_t kRecordsPerTask = std::size_t{1} << 14;

struct Array {
  std::size_t rows = 0;
  std::string_view text;  // of its data, in base64
};

// The one array of that intent.
Array array_of(const std::vector<XmlElement>& elements, std::string_view file,
               std::string_view intent, std::string_view type) {
  const auto is_array = [&](const XmlElement& element) {
    return element.path == "GIFTI/DataArray" && element.attribute("Intent", kFormat) == intent;
  };
  const auto array = std::ranges::find_if(elements, is_array);
  if (array == elements.end()) refuse(kFormat, "it has no " + std::string(intent));
  const auto has = [&](std::string_view name, std::string_view value) {
    return array->attribute(name, kFormat) == value;
  };
  if (!has("DataType", type) || !has("Encoding", "Base64Binary") ||
      !has("Endian", "LittleEndian") || !has("ArrayIndexingOrder", "RowMajorOrder") ||
      !has("Dimensionality", "2") || !has("Dim1", "3")) {
    refuse(kFormat, "an array has wrong attributes");
  }
  const auto data = std::find_if(array, elements.end(), [](const XmlElement& element) {
    return element.path == "GIFTI/DataArray/Data";
  });
  if (data == elements.end()) refuse(kFormat, "an array has no data");
  const auto [rows] = numbers_of<std::uint32_t, 1>(array->attribute("Dim0", kFormat), kFormat);
  const std::string_view text = file.substr(data->begin, data->end - data->begin);
  if (text.size() != rows * kRecordText) {
    refuse(kFormat, "an array has the wrong size");
  }
  return {rows, text};
}

template <class Record>
void read(const Array& array, const mesh::Context& context, mesh::Buffer<Record>& records) {
  static_assert(sizeof(Record) == kRecordText / 4 * 3);
  records.resize_for_overwrite(array.rows);
  const std::size_t tasks = tasks_of(array.rows, kRecordsPerTask);
  mesh::parallel_for({context.stop, nullptr}, tasks, [&](std::size_t task) {
    const std::size_t begin = task * kRecordsPerTask;
    const std::size_t count = std::min(kRecordsPerTask, array.rows - begin);
    const auto bytes = from_base64(array.text.substr(begin * kRecordText, count * kRecordText));
    if (!bytes || bytes->size() != count * sizeof(Record)) {
      refuse(kFormat, "an array is not base64");
    }
    std::memcpy(records.data() + begin, bytes->data(), bytes->size());
  });
}

}  // namespace

DecodedSurface decode_gii(Bytes file, const mesh::Context& context) {
  const std::vector<XmlElement> elements = elements_of(file, kFormat, "", context);
  const std::string_view text = as_text(file);
  DecodedSurface surface;
  if (elements.front().path != "GIFTI") refuse(kFormat, "it is not GIFTI");
  if (elements.front().attribute("NumberOfDataArrays", kFormat) == "0") return surface;
  read(array_of(elements, text, "NIFTI_INTENT_POINTSET", "NIFTI_TYPE_FLOAT32"), context,
       surface.positions);
  read(array_of(elements, text, "NIFTI_INTENT_TRIANGLE", "NIFTI_TYPE_INT32"), context,
       surface.triangles);
  return surface;
}

}  // namespace isomesh::codec::decoding
