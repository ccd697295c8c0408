#include "tests/support/deflate.h"

#include <stdexcept>

#include <bzlib.h>
#include <zlib.h>

namespace isomesh::test {
namespace {

// `window_bits` select the stream's wrapping in zlib.
std::string deflated(std::string_view bytes, int window_bits) {
  z_stream stream = {};
  if (deflateInit2(&stream, 6, Z_DEFLATED, window_bits, 8, Z_DEFAULT_STRATEGY) != Z_OK) {
    throw std::runtime_error("deflateInit2 failed");
  }
  std::string result(deflateBound(&stream, bytes.size()) + 32, '\0');
  stream.next_in = reinterpret_cast<Bytef*>(const_cast<char*>(bytes.data()));
  stream.avail_in = static_cast<uInt>(bytes.size());
  stream.next_out = reinterpret_cast<Bytef*>(result.data());
  stream.avail_out = static_cast<uInt>(result.size());
  const int end = deflate(&stream, Z_FINISH);
  result.resize(stream.total_out);
  deflateEnd(&stream);
  if (end != Z_STREAM_END) throw std::runtime_error("deflate failed");
  return result;
}

}  // namespace

std::string gzip(std::string_view bytes) { return deflated(bytes, MAX_WBITS + 16); }
std::string zlib(std::string_view bytes) { return deflated(bytes, MAX_WBITS); }
std::string raw_deflate(std::string_view bytes) { return deflated(bytes, -MAX_WBITS); }

std::string bzip2(std::string_view bytes) {
  constexpr std::size_t kMostOverhead = 600;  // beside 1 % of the bytes
  std::string source(bytes);
  std::string packed(source.size() + source.size() / 100 + kMostOverhead, '\0');
  auto size = static_cast<unsigned>(packed.size());
  constexpr int kBlocks = 9;
  if (BZ2_bzBuffToBuffCompress(packed.data(), &size, source.data(),
                               static_cast<unsigned>(source.size()), kBlocks, 0, 0) != BZ_OK) {
    throw std::runtime_error("bzip2 failed");
  }
  packed.resize(size);
  return packed;
}

}  // namespace isomesh::test
