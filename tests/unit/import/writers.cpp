#include "tests/unit/import/writers.h"

namespace isomesh::import::test {
namespace {

// Puts numbers into a header at the places that the standard names.
class Header {
 public:
  Header(std::size_t size, bool big_endian) : bytes_(size, '\0'), big_endian_(big_endian) {}

  template <class Stored, class Value>
  void put(std::size_t offset, const std::vector<Value>& values) {
    std::vector<Stored> stored;
    stored.reserve(values.size());
    for (const Value value : values) stored.push_back(static_cast<Stored>(value));
    put_text(offset, bytes_of(stored, big_endian_));
  }
  void put_text(std::size_t offset, std::string_view text) {
    std::copy(text.begin(), text.end(), bytes_.begin() + static_cast<std::ptrdiff_t>(offset));
  }
  const std::string& bytes() const { return bytes_; }

 private:
  std::string bytes_;
  bool big_endian_;
};

std::string magic_of(const NiftiFields& fields) {
  using std::string_literals::operator""s;
  if (!fields.magic.empty()) return fields.magic;
  return fields.version == 1 ? "n+1\0"s : "n+2\0\r\n\032\n"s;
}

std::string nifti1_header(const NiftiFields& f) {
  Header header(352, f.big_endian);
  header.put<std::int32_t>(0, std::vector{348});
  header.put<std::int16_t>(40, f.dim);
  header.put<std::int16_t>(70, std::vector{f.datatype, f.bitpix});
  header.put<float>(76, f.pixdim);
  header.put<float>(108, std::vector{f.vox_offset < 0 ? 352 : f.vox_offset, f.slope, f.intercept});
  header.put<std::uint8_t>(123, std::vector{f.units});
  header.put<std::int16_t>(252, std::vector{f.qform_code, f.sform_code});
  header.put<float>(256, f.quaternion);
  header.put<float>(268, f.qoffset);
  header.put<float>(280, f.srow);
  header.put_text(344, magic_of(f));
  return header.bytes();
}

std::string nifti2_header(const NiftiFields& f) {
  Header header(544, f.big_endian);
  header.put<std::int32_t>(0, std::vector{540});
  header.put_text(4, magic_of(f));
  header.put<std::int16_t>(12, std::vector{f.datatype, f.bitpix});
  header.put<std::int64_t>(16, f.dim);
  header.put<double>(104, f.pixdim);
  header.put<std::int64_t>(168, std::vector{f.vox_offset < 0 ? 544 : f.vox_offset});
  header.put<double>(176, std::vector{f.slope, f.intercept});
  header.put<std::int32_t>(344, std::vector{f.qform_code, f.sform_code});
  header.put<double>(352, f.quaternion);
  header.put<double>(376, f.qoffset);
  header.put<double>(400, f.srow);
  header.put<std::int32_t>(500, std::vector{f.units});
  return header.bytes();
}

std::string joined(const Lines& lines, std::string_view separator) {
  std::string text;
  for (const auto& [name, value] : lines) {
    text += name;
    text += separator;
    text += value;
    text += '\n';
  }
  return text;
}

}  // namespace

std::string nifti(const NiftiFields& fields, std::string_view samples) {
  return (fields.version == 1 ? nifti1_header(fields) : nifti2_header(fields)) +
         std::string(samples);
}

std::string nrrd(const Lines& lines, std::string_view payload) {
  std::string file = "NRRD0004\n# written by a test\n";
  file += joined(lines, ": ");
  file += '\n';
  file += payload;
  return file;
}

std::string metaimage(const Lines& lines, std::string_view payload) {
  return joined(lines, " = ") + std::string(payload);
}

Lines with(Lines lines, const std::string& name, const std::string& value) {
  const auto found = std::find_if(lines.begin(), lines.end(),
                                  [&](const auto& line) { return line.first == name; });
  if (found == lines.end()) {
    lines.insert(lines.end() - 1, {name, value});
  } else if (value.empty()) {
    lines.erase(found);
  } else {
    found->second = value;
  }
  return lines;
}

Lines small_nrrd() {
  return {{"type", "uint8"},
          {"dimension", "3"},
          {"space", "left-posterior-superior"},
          {"sizes", "4 3 2"},
          {"space directions", "(1,0,0) (0,1,0) (0,0,1)"},
          {"space origin", "(0,0,0)"},
          {"encoding", "raw"}};
}

Lines small_metaimage() {
  return {{"ObjectType", "Image"},     {"NDims", "3"},
          {"BinaryData", "True"},      {"BinaryDataByteOrderMSB", "False"},
          {"CompressedData", "False"}, {"TransformMatrix", "1 0 0 0 1 0 0 0 1"},
          {"Offset", "0 0 0"},         {"ElementSpacing", "1 1 1"},
          {"DimSize", "4 3 2"},        {"ElementType", "MET_UCHAR"},
          {"ElementDataFile", "LOCAL"}};
}

}  // namespace isomesh::import::test
