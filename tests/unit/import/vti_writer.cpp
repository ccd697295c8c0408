#include "tests/unit/import/vti_writer.h"

#include <stdexcept>
#include <vector>

#include <lz4.h>
#include <lzma.h>

#include "base/base64.h"
#include "tests/unit/import/writers.h"

namespace isomesh::import::test {
namespace {

std::string counts(const VtiFields& f, const std::vector<std::uint64_t>& values) {
  if (f.wide_header) return bytes_of(values, f.big_endian);
  return bytes_of(std::vector<std::uint32_t>(values.begin(), values.end()), f.big_endian);
}

std::string lz4(std::string_view bytes) {
  std::string block(static_cast<std::size_t>(::LZ4_compressBound(static_cast<int>(bytes.size()))),
                    '\0');
  const int size = ::LZ4_compress_default(
      bytes.data(), block.data(), static_cast<int>(bytes.size()), static_cast<int>(block.size()));
  block.resize(static_cast<std::size_t>(size));
  return block;
}

std::string xz(std::string_view bytes) {
  std::string block(::lzma_stream_buffer_bound(bytes.size()), '\0');
  std::size_t size = 0;
  const auto result = ::lzma_easy_buffer_encode(
      5, LZMA_CHECK_CRC32, nullptr, reinterpret_cast<const std::uint8_t*>(bytes.data()),
      bytes.size(), reinterpret_cast<std::uint8_t*>(block.data()), &size, block.size());
  if (result != LZMA_OK) throw std::runtime_error("lzma_easy_buffer_encode failed");
  block.resize(size);
  return block;
}

std::string compressed(const VtiFields& f, std::string_view bytes) {
  if (f.compressor == "vtkLZ4DataCompressor") return lz4(bytes);
  if (f.compressor == "vtkLZMADataCompressor") return xz(bytes);
  return zlib(bytes);
}

// An encoded array: the header that precedes its bytes, and the bytes.
struct Encoded {
  std::string header;
  std::string bytes;
};

Encoded encode(const VtiFields& f, std::string_view samples) {
  if (!f.compressed) return {counts(f, {samples.size()}), std::string(samples)};
  std::vector<std::uint64_t> sizes;
  std::string blocks;
  for (std::size_t at = 0; at < samples.size(); at += f.block_bytes) {
    const std::string block = compressed(f, samples.substr(at, f.block_bytes));
    sizes.push_back(block.size());
    blocks += block;
  }
  sizes.insert(sizes.begin(), {sizes.size(), f.block_bytes, samples.size() % f.block_bytes});
  return {counts(f, sizes), blocks};
}

std::string array_bytes(const VtiFields& f, std::string_view samples) {
  const auto [header, bytes] = encode(f, samples);
  if (f.form == VtiForm::kAppendedRaw) return header + bytes;
  return f.compressed ? to_base64(header) + to_base64(bytes) : to_base64(header + bytes);
}

bool is_appended(const VtiFields& f) {
  return f.form == VtiForm::kAppendedRaw || f.form == VtiForm::kAppendedBase64;
}

std::string array(const VtiFields& f, std::string_view samples, const std::string& ahead) {
  std::string text = "<DataArray Name=\"samples\" type=\"" + f.type + "\" NumberOfComponents=\"" +
                     f.components + "\" format=\"";
  if (f.form == VtiForm::kAscii) {
    return text + "ascii\">\n " + std::string(samples) + "\n</DataArray>";
  }
  if (f.form == VtiForm::kBinary) {
    return text + "binary\">\n   " + array_bytes(f, samples) + "\n  </DataArray>";
  }
  return text + "appended\" offset=\"" + std::to_string(ahead.size()) + "\"/>";
}

}  // namespace

std::string vti(const VtiFields& f, std::string_view samples) {
  // Something that lies before the samples, as another array would.
  const std::string ahead = f.form == VtiForm::kAppendedBase64 ? "AAAA" : std::string("\0_<&", 4);
  const std::string piece = f.piece_extent.empty() ? f.extent : f.piece_extent;
  const std::string compressor = f.compressor.empty() ? "vtkZLibDataCompressor" : f.compressor;
  std::string file = "<?xml version=\"1.0\"?>\n<VTKFile type=\"" + f.kind +
                     "\" version=\"1.0\" byte_order=\"" +
                     (f.big_endian ? "BigEndian" : "LittleEndian") + "\"";
  if (f.wide_header) file += " header_type=\"UInt64\"";
  if (f.compressed) file += " compressor=\"" + compressor + "\"";
  file += ">\n<" + f.kind + " WholeExtent=\"" + f.extent + "\" Origin=\"" + f.origin +
          "\" Spacing=\"" + f.spacing + "\" Direction=\"" + f.direction + "\">\n<Piece Extent=\"" +
          piece + "\">\n<PointData Scalars=\"" + f.scalars + "\">\n" + f.more +
          array(f, samples, ahead) + "\n</PointData>\n<CellData/>\n</Piece>\n</" + f.kind + ">\n";
  if (is_appended(f)) {
    const std::string encoding = f.form == VtiForm::kAppendedRaw ? "raw" : "base64";
    file += "<AppendedData encoding=\"" + encoding + "\">\n _" + ahead + array_bytes(f, samples) +
            "\n</AppendedData>\n";
  }
  return file + "</VTKFile>";
}

}  // namespace isomesh::import::test
