// Records of a file in bounded memory; private to this folder.
#pragma once

#include <cstddef>
#include <functional>
#include <vector>

#include "server/codec/encode.h"

namespace isomesh::codec {

// Hands equal jobs of formatting to several threads and the bytes to one sink in order. Holds a
// block of bytes a thread. Not thread safe.
class BlockWriter {
 public:
  // `records` is how many all calls of write will write together, for the progress.
  BlockWriter(const mesh::Context& context, const Sink& sink, std::size_t records)
      : context_(context), sink_(sink), records_(records) {}

  // Writes the records [0, count). one_record(index, out) formats one at `out` and returns where it
  // ends, at most `most_bytes` behind; it is called from several threads. Throws Error kCancelled,
  // looked at before each block.
  template <class OneRecord>
  void write(std::size_t count, std::size_t most_bytes, OneRecord one_record) {
    write_blocks(count, most_bytes, [&](std::size_t begin, std::size_t end, std::byte* out) {
      for (std::size_t index = begin; index < end; ++index) out = one_record(index, out);
      return out;
    });
  }

 private:
  using FormatRun = std::function<std::byte*(std::size_t begin, std::size_t end, std::byte* out)>;

  struct Block {
    std::vector<std::byte> bytes;
    std::size_t used = 0;
  };

  void write_blocks(std::size_t count, std::size_t most_bytes, const FormatRun& format);

  const mesh::Context& context_;
  const Sink& sink_;
  const std::size_t records_;
  std::size_t done_ = 0;
  std::vector<Block> blocks_;
};

}  // namespace isomesh::codec
